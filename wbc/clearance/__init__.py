"""Proven clearances of moving bodies: exact distances, and bounds on motion between instants (floor 3)."""

from wbc.clearance.motion import Motion as Motion
from wbc.clearance.scene import (
    CylinderInside as CylinderInside,
    EndlessCylinder as EndlessCylinder,
    Exemption as Exemption,
    Pair as Pair,
    SweptBody as SweptBody,
    SweptScene as SweptScene,
    bodies_of as bodies_of,
    self_pairs as self_pairs,
)
from wbc.clearance.sweep import Nearest as Nearest, Sweep as Sweep, Sweeper as Sweeper
from wbc.clearance.tree import Tree as Tree
from wbc.clearance.triangle_mesh import TriangleMesh as TriangleMesh
