"""The log of a walk: the table of its ticks, what writes it, and paths of a body as plain data."""

from wbc.walking.log.log import WalkLog, WalkLogError
from wbc.walking.log.recorder import LogRecorder

__all__ = ["LogRecorder", "WalkLog", "WalkLogError"]
