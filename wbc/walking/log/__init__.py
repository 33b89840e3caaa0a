"""The log of a walk: its ticks, what writes them while walking and as a whole, and paths of a body as plain data."""

from wbc.walking.log.log import WalkLog, WalkLogError
from wbc.walking.log.recorder import LogRecorder
from wbc.walking.log.ticks import TickColumns

__all__ = ["LogRecorder", "TickColumns", "WalkLog", "WalkLogError"]
