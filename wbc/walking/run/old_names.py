"""What requests and runs were called before each mode had a dataclass: kept for one version, with a warning."""

from __future__ import annotations

import os
import warnings
from collections.abc import Callable, Sequence
from typing import Any

from wbc.robots import Walker
from wbc.walking.modes.commands import Commands
from wbc.walking.run.places import Place
from wbc.walking.run.request import DriveRequest, read_request
from wbc.walking.run.resume_mode import ResumeRequest
from wbc.walking.run.session import WalkRun, perform_walk


def perform_drive(request: DriveRequest, walker: Walker, commands: Commands, **more: Any) -> WalkRun:
    """``perform_walk(request, walker, commands=commands)``."""
    return perform_walk(request, walker, commands=commands, **more)


def perform_resume(
    folder: str | os.PathLike[str],
    walker: Walker,
    *,
    at: float | None = None,
    points: Sequence[Place] = (),
    **more: Any,
) -> WalkRun:
    """``perform_walk(ResumeRequest(folder, at, points), walker)``."""
    return perform_walk(ResumeRequest(folder, at, tuple(points)), walker, **more)


#: Old name -> (what it does, what to write instead)
_OLD: dict[str, tuple[Callable[..., Any], str]] = {
    "WalkRequest": (read_request, "PathRequest, DriveRequest, ArmRequest or TwoEndedRequest"),
    "perform_arm": (perform_walk, "perform_walk"),
    "perform_drive": (perform_drive, "perform_walk(..., commands=...)"),
    "perform_resume": (perform_resume, "perform_walk(ResumeRequest(...), ...)"),
    "perform_two_ended": (perform_walk, "perform_walk"),
}


def found(module: str, name: str) -> Any:
    """What an old name of a module stands for.

    Raises:
        AttributeError: it is none.
    """
    if name not in _OLD:
        raise AttributeError(f"module {module!r} has no attribute {name!r}")
    what, now = _OLD[name]
    warnings.warn(f"{module}.{name} is now {now}", DeprecationWarning, stacklevel=3)
    return what
