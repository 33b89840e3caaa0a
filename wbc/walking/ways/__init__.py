"""Ways round: where the body can go when it cannot follow its path as it is."""

from wbc.walking.ways.body_route import BodyRoute, find_route
from wbc.walking.ways.cells import ALONG, WIDE, Mesh

__all__ = ["ALONG", "WIDE", "BodyRoute", "Mesh", "find_route"]
