"""Inverse kinematics of a stack (floor 7)."""

from __future__ import annotations

import warnings
from typing import Any

from wbc.ik.branches import Branches
from wbc.ik.continuation import PathBranch
from wbc.ik.inverse_kinematics import InverseKinematics
from wbc.ik.solution import Batch, Ending, Solution

__all__ = ["Batch", "Branches", "Ending", "InverseKinematics", "PathBranch", "Solution"]


#: Old names, for one version
_OLD = {"Branch": PathBranch, "Solver": InverseKinematics}


def __getattr__(name: str) -> Any:
    if name not in _OLD:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    warnings.warn(f"{name} is called {_OLD[name].__name__} now", DeprecationWarning, stacklevel=2)
    return _OLD[name]
