"""Modules under the names that they had before the rooms: for one version they lead to the new ones, with a warning."""

from __future__ import annotations

import importlib
import sys
import warnings
from collections.abc import Sequence
from importlib.abc import Loader, MetaPathFinder
from importlib.machinery import ModuleSpec
from types import ModuleType

#: Old name -> new name, of modules that pages named
MOVED = {
    "wbc.walking.arm_kinematics": "wbc.walking.arms.puma",
    "wbc.walking.arm_mode": "wbc.walking.modes.arm_mode",
    "wbc.walking.drive": "wbc.walking.modes.drive",
    "wbc.walking.first_grasps": "wbc.walking.modes.first_grasps",
    "wbc.walking.followed_plan": "wbc.walking.planner.follow",
    "wbc.walking.plan": "wbc.walking.planner.plan",
    "wbc.walking.plan_time": "wbc.walking.planner.plan_time",
    "wbc.walking.published": "wbc.published.three_arm_walker",
    "wbc.walking.replanning": "wbc.walking.planner.replanning",
    "wbc.walking.run.perform": "wbc.walking.run.session",
    "wbc.walking.run_log": "wbc.walking.log.log",
    "wbc.walking.run_recorder": "wbc.walking.log.recorder",
    "wbc.walking.structures": "wbc.walking.holds.built_in",
    "wbc.walking.two_ended_kinematics": "wbc.walking.arms.two_ended",
    "wbc.walking.walk": "wbc.walking.loop.walk",
}


class _OldNames(MetaPathFinder, Loader):
    """Asked last, when nothing else knows a module."""

    def find_spec(
        self, fullname: str, path: Sequence[str] | None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        return ModuleSpec(fullname, self) if fullname in MOVED else None

    def exec_module(self, module: ModuleType) -> None:
        old = module.__name__
        warnings.warn(f"{old} is now {MOVED[old]}", DeprecationWarning, stacklevel=2)
        # What stands here afterwards is what the import returns
        sys.modules[old] = importlib.import_module(MOVED[old])


def keep_old_names() -> None:
    """Let ``import`` find modules under their old names."""
    if not any(isinstance(finder, _OldNames) for finder in sys.meta_path):
        sys.meta_path.append(_OldNames())
