"""Runs: walks as they are asked for, carried out, logged, and shown in a folder."""

from __future__ import annotations

from typing import TYPE_CHECKING

from wbc import lazy

if TYPE_CHECKING:
    from wbc.walking.run.places import GridPlace
    from wbc.walking.run.request import ArmRequest, DriveRequest, PathRequest, ResumeRequest, Site, TwoEndedRequest
    from wbc.walking.run.session import WalkRun, perform_walk
else:
    __getattr__ = lazy.attach(__name__, __file__)

__all__ = [
    "ArmRequest",
    "DriveRequest",
    "GridPlace",
    "PathRequest",
    "ResumeRequest",
    "Site",
    "TwoEndedRequest",
    "WalkRun",
    "perform_walk",
]
