"""Where a moving frame is and how it moves, from measurements of its pose; the calibration of what measures it; and
what acts on a robot that nobody commanded.
"""

from wbc.estimation.calibration import Calibration, calibrate
from wbc.estimation.momentum_observer import MomentumObserver
from wbc.estimation.pose_filter import FrameMotion, PoseFilter
from wbc.estimation.pose_stream import DropoutPolicy, FrameEstimate, PoseStream, StreamState

__all__ = [
    "Calibration",
    "DropoutPolicy",
    "FrameEstimate",
    "FrameMotion",
    "MomentumObserver",
    "PoseFilter",
    "PoseStream",
    "StreamState",
    "calibrate",
]
