"""Laws of motion: paths, timings, and certificates of the limits that they keep."""

from __future__ import annotations

from typing import TYPE_CHECKING

from wbc import lazy

if TYPE_CHECKING:
    from wbc.trajectory.following import Followed as Followed, follow as follow
    from wbc.trajectory.jerk.along import jerk_limited_along as jerk_limited_along
    from wbc.trajectory.jerk.between_states import jerk_limited as jerk_limited
    from wbc.trajectory.jerk.online_filter import Online as Online, online as online
    from wbc.trajectory.jerk.via_poses import via_points as via_points
    from wbc.trajectory.laws.certificate import LawCertificate as LawCertificate, Worst as Worst
    from wbc.trajectory.laws.law import Law as Law, State as State, load as load
    from wbc.trajectory.laws.limits import MotionLimits as MotionLimits
    from wbc.trajectory.laws.plots import plot as plot
    from wbc.trajectory.laws.timing import Timing as Timing
    from wbc.trajectory.least_time.time_optimal import time_optimal as time_optimal
    from wbc.trajectory.paths.arcs import arc_path as arc_path, arc_through as arc_through
    from wbc.trajectory.paths.from_function import FunctionPath as FunctionPath, function_path as function_path
    from wbc.trajectory.paths.joint_paths import (
        blend_path as blend_path,
        spline_path as spline_path,
        standing_path as standing_path,
        straight_path as straight_path,
    )
    from wbc.trajectory.paths.path import Path as Path, PolynomialPath as PolynomialPath
    from wbc.trajectory.paths.pose_path import PosePath as PosePath
    from wbc.trajectory.paths.pose_paths import (
        geodesic_path as geodesic_path,
        pose_polyline as pose_polyline,
        pose_spline as pose_spline,
    )
    from wbc.trajectory.together import Laws as Laws, many as many
else:
    # toppra, ruckig and matplotlib cost nothing until they are used
    __getattr__, __dir__, __all__ = lazy.attach(__name__, __file__)
