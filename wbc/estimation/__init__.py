"""Where a moving frame is and how it moves, from measurements of its pose; and the calibration of what measures it."""

from wbc.estimation.calibration import Calibration, calibrate
from wbc.estimation.pose_filter import FrameMotion, PoseFilter
from wbc.estimation.pose_stream import DropoutPolicy, FrameEstimate, PoseStream, StreamState

__all__ = [
    "Calibration",
    "DropoutPolicy",
    "FrameEstimate",
    "FrameMotion",
    "PoseFilter",
    "PoseStream",
    "StreamState",
    "calibrate",
]
