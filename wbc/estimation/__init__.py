"""Where a moving frame is and how it moves, from measurements of its pose; the calibration of what measures it; and
what acts on a robot that nobody commanded.
"""

from wbc.estimation.calibration import Calibration as Calibration, calibrate as calibrate
from wbc.estimation.momentum_observer import MomentumObserver as MomentumObserver
from wbc.estimation.pose_filter import FrameMotion as FrameMotion, PoseFilter as PoseFilter
from wbc.estimation.pose_stream import (
    DropoutPolicy as DropoutPolicy,
    FrameEstimate as FrameEstimate,
    PoseStream as PoseStream,
    StreamState as StreamState,
)
