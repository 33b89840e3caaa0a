"""Robots by name, from files, from models and from Denavit-Hartenberg rows."""

from wbc.robot.dh import DHRow
from wbc.robot.geometry import fit_shapes
from wbc.robots.catalogue import from_dh, load, names, table

__all__ = ["DHRow", "fit_shapes", "from_dh", "load", "names", "table"]
