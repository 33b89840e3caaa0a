"""Proven clearances of moving bodies: exact distances, and bounds on motion between instants (floor 3)."""

from wbc.clearance.motion import Motion
from wbc.clearance.scene import Exemption, Pair, SweptBody, SweptScene, bodies_of, self_pairs
from wbc.clearance.sweep import Nearest, Sweep, Sweeper
from wbc.clearance.tree import Tree
from wbc.clearance.triangle_mesh import TriangleMesh
from wbc.clearance.walls import CylinderInside, EndlessCylinder

__all__ = [
    "CylinderInside",
    "EndlessCylinder",
    "Exemption",
    "Motion",
    "Nearest",
    "Pair",
    "Sweep",
    "Sweeper",
    "SweptBody",
    "SweptScene",
    "Tree",
    "TriangleMesh",
    "bodies_of",
    "self_pairs",
]  # fmt: skip
