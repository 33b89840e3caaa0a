"""Runs: walks as they are asked for, carried out, logged, and shown in a folder."""

from __future__ import annotations

from typing import Any

from wbc.walking.run import old_names
from wbc.walking.run.places import GridPlace
from wbc.walking.run.request import ArmRequest, DriveRequest, PathRequest, Site, TwoEndedRequest
from wbc.walking.run.resume_mode import ResumeRequest
from wbc.walking.run.session import WalkRun, perform_walk

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


def __getattr__(name: str) -> Any:
    return old_names.found(__name__, name)
