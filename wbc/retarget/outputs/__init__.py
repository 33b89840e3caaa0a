"""What a retargeted motion is written as: arrays, tables, MuJoCo's keyframes, logs, and what learners load."""

from __future__ import annotations

from typing import TYPE_CHECKING

from wbc import lazy

if TYPE_CHECKING:
    from wbc.retarget.outputs.motion import JointColumns as JointColumns
    from wbc.retarget.outputs.writing import (
        MOTION_FORMATS as MOTION_FORMATS,
        write_lerobot as write_lerobot,
        write_motion as write_motion,
    )
else:
    __getattr__, __dir__, __all__ = lazy.attach(__name__, __file__)
