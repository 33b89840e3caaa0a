"""Arms under manual control: orders at 50 Hz from a program, a file or a keyboard. See docs/teleoperation.md."""

from __future__ import annotations

from wbc.teleop.keyboard import Keyboard as Keyboard
from wbc.teleop.loop import SessionLog as SessionLog, run_session as run_session
from wbc.teleop.order import Order as Order, Source as Source
from wbc.teleop.rate_file import RateFile as RateFile, RateFileError as RateFileError
from wbc.teleop.session import Seen as Seen, Teleoperation as Teleoperation
