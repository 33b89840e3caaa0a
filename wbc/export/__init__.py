"""A compiled stack as a folder of C: the tick, its solver, a header, a build and a check (floor 7)."""

from wbc.export.exporting import export
from wbc.export.folder import ExportError, checked_folder, write
from wbc.export.snapshot import Snapshot

__all__ = ["ExportError", "Snapshot", "checked_folder", "export", "write"]
