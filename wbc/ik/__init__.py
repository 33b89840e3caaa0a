"""Inverse kinematics of a stack (floor 7)."""

from __future__ import annotations

import warnings
from typing import Any

from wbc.ik.branches import Branches
from wbc.ik.continuation import Branch
from wbc.ik.inverse_kinematics import InverseKinematics
from wbc.ik.solution import Batch, Ending, Solution

__all__ = ["Batch", "Branch", "Branches", "Ending", "InverseKinematics", "Solution"]


def __getattr__(name: str) -> Any:
    if name == "Solver":
        warnings.warn("Solver is called InverseKinematics now", DeprecationWarning, stacklevel=2)
        return InverseKinematics
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
