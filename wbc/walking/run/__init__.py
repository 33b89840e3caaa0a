"""Runs: walks as they are asked for, carried out, logged, and shown in a folder."""

from __future__ import annotations

from typing import TYPE_CHECKING

from wbc import lazy

if TYPE_CHECKING:
    from wbc.walking.run.places import GridPlace as GridPlace
    from wbc.walking.run.request import (
        ArmRequest as ArmRequest,
        DriveRequest as DriveRequest,
        PathRequest as PathRequest,
        ResumeRequest as ResumeRequest,
        Site as Site,
    )
    from wbc.walking.run.session import WalkRun as WalkRun, perform_walk as perform_walk
else:
    __getattr__, __dir__, __all__ = lazy.attach(__name__, __file__)
