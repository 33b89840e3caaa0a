"""Inverse kinematics of a stack (floor 7)."""

from __future__ import annotations

from wbc.ik.branches import Branches
from wbc.ik.continuation import PathBranch
from wbc.ik.inverse_kinematics import InverseKinematics
from wbc.ik.solution import BatchSolution, Ending, Solution

__all__ = ["BatchSolution", "Branches", "Ending", "InverseKinematics", "PathBranch", "Solution"]
