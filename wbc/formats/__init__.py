"""Runs in the formats of other tools, and motions from these (floor 13). See docs/logs.md."""

from typing import TYPE_CHECKING

from wbc import lazy

if TYPE_CHECKING:
    from wbc.formats.conversion import FORMATS as FORMATS, convert as convert, recorded as recorded
    from wbc.formats.errors import FormatError as FormatError
    from wbc.formats.motion import PlayedPlant as PlayedPlant, RecordedMotion as RecordedMotion
    from wbc.formats.motion_file import read_motion as read_motion
    from wbc.formats.ros2_plant import Ros2Plant as Ros2Plant
else:
    __getattr__, __dir__, __all__ = lazy.attach(__name__, __file__)
