"""The one kernel of distances between shapes, in C, and what Python asks of it (floor 1)."""

from wbc.geometry.kernel import HEADERS, ShapeTable, distances, segment_distances, segments_from

__all__ = ["HEADERS", "ShapeTable", "distances", "segment_distances", "segments_from"]
