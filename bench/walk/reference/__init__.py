"""What is possible: a search over body poses on a lattice, by closed-form kinematics alone."""

from bench.walk.reference.along import fewest_along
from bench.walk.reference.judge import Reference
from bench.walk.reference.lattice import GridPose, Lattice
from bench.walk.reference.rules import RELAXED, STRICT, Rules
from bench.walk.reference.verdict import Step, Verdict

__all__ = ["RELAXED", "STRICT", "GridPose", "Lattice", "Reference", "Rules", "Step", "Verdict", "fewest_along"]
