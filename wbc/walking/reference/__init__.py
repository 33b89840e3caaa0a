"""What is possible: a search over body poses on a lattice, by closed-form kinematics alone."""

from wbc.walking.reference.along import fewest_along
from wbc.walking.reference.judge import Reference
from wbc.walking.reference.lattice import GridPose, Lattice
from wbc.walking.reference.rules import RELAXED, STRICT, Rules
from wbc.walking.reference.verdict import Step, Verdict

__all__ = ["RELAXED", "STRICT", "GridPose", "Lattice", "Reference", "Rules", "Step", "Verdict", "fewest_along"]
