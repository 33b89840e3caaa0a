"""Inverse kinematics of a stack (floor 7)."""

from wbc.ik.branches import Branches
from wbc.ik.continuation import Branch
from wbc.ik.solution import Batch, Ending, Solution
from wbc.ik.solver import Solver

__all__ = ["Batch", "Branch", "Branches", "Ending", "Solution", "Solver"]
