"""Laws of motion: paths, timings, and certificates of the limits that they keep."""

from __future__ import annotations

from typing import TYPE_CHECKING

from wbc import lazy

if TYPE_CHECKING:
    from wbc.trajectory.following import Followed, follow
    from wbc.trajectory.jerk.along import jerk_limited_along
    from wbc.trajectory.jerk.between_states import jerk_limited
    from wbc.trajectory.jerk.online_filter import Online, online
    from wbc.trajectory.jerk.via_poses import via_points
    from wbc.trajectory.laws.certificate import LawCertificate, Worst
    from wbc.trajectory.laws.law import Law, State, load
    from wbc.trajectory.laws.limits import MotionLimits
    from wbc.trajectory.laws.plots import plot
    from wbc.trajectory.laws.timing import Timing
    from wbc.trajectory.least_time.time_optimal import time_optimal
    from wbc.trajectory.paths.arcs import arc_path, arc_through
    from wbc.trajectory.paths.from_function import FunctionPath, function_path
    from wbc.trajectory.paths.joint_paths import blend_path, spline_path, standing_path, straight_path
    from wbc.trajectory.paths.path import Path, PolynomialPath
    from wbc.trajectory.paths.pose_path import PosePath
    from wbc.trajectory.paths.pose_paths import geodesic_path, pose_polyline, pose_spline
    from wbc.trajectory.together import Laws, many
else:
    # toppra, ruckig and matplotlib cost nothing until they are used
    __getattr__ = lazy.attach(__name__, __file__)

__all__ = [
    "Followed",
    "FunctionPath",
    "Law",
    "LawCertificate",
    "Laws",
    "MotionLimits",
    "Online",
    "Path",
    "PolynomialPath",
    "PosePath",
    "State",
    "Timing",
    "Worst",
    "arc_path",
    "arc_through",
    "blend_path",
    "follow",
    "function_path",
    "geodesic_path",
    "jerk_limited",
    "jerk_limited_along",
    "load",
    "many",
    "online",
    "plot",
    "pose_polyline",
    "pose_spline",
    "spline_path",
    "standing_path",
    "straight_path",
    "time_optimal",
    "via_points",
]


def __dir__() -> list[str]:
    return __all__
