"""Inverse kinematics of a stack (floor 7)."""

from __future__ import annotations

from wbc.ik.branches import Branches
from wbc.ik.continuation import PathBranch
from wbc.ik.inverse_kinematics import InverseKinematics
from wbc.ik.solution import Batch, Ending, Solution

__all__ = ["Batch", "Branches", "Ending", "InverseKinematics", "PathBranch", "Solution"]
