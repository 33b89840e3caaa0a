"""Arms under manual control: orders at 50 Hz from a program, a file or a keyboard. See docs/teleoperation.md."""

from __future__ import annotations

from wbc.teleop.keyboard import Keyboard
from wbc.teleop.loop import SessionLog, run_session
from wbc.teleop.order import Order, Source
from wbc.teleop.rate_file import RateFile, RateFileError
from wbc.teleop.session import Seen, Teleoperation

__all__ = [
    "Keyboard",
    "Order",
    "RateFile",
    "RateFileError",
    "Seen",
    "SessionLog",
    "Source",
    "Teleoperation",
    "run_session",
]
