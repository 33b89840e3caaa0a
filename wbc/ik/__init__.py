"""Inverse kinematics of a stack (floor 7)."""

from wbc.controller import hooks
from wbc.ik.branches import Branches
from wbc.ik.continuation import Branch
from wbc.ik.solution import Batch, Ending, Solution
from wbc.ik.solver import Solver

__all__ = ["Batch", "Branch", "Branches", "Ending", "Solution", "Solver"]

hooks.solver = Solver
