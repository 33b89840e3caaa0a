"""What paths, laws and timings refuse: the error, its field, and nearest names."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

from tests.refusals import assert_refused
from tests.trajectory.path_checks import random_poses
from tests.trajectory.random_laws import smooth
from wbc import trajectory
from wbc.errors import (
    BoundsError,
    ContinuityError,
    InfeasibleError,
    NotFiniteError,
    RangeError,
    RotationError,
    ShapeError,
    UnknownNameError,
    WbcError,
)
from wbc.trajectory import Law, MotionLimits, PolynomialPath, PosePath, Timing
from wbc.trajectory.paths.path import JoinedPath

#: Untyped, to be called wrongly
T: Any = trajectory
NAN, INF = np.nan, np.inf
LINE = np.array([[0.0, 0.0], [1.0, 2.0], [2.0, 1.0]])
CORNER = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0]]
POSES = random_poses(9, 3)
HALF, FAR = (pin.SE3(POSES[0].rotation @ pin.exp3(np.array([x, 0.0, 0.0])), POSES[1].translation) for x in (np.pi, 3.0))
UNIT = PolynomialPath([0.0, 1.0], [[[1.0]], [[0.0]]])
JERK = {"start": [0.0, 0.0], "target": [1.0, 2.0], "velocity": 1.0, "acceleration": 1.0, "jerk": 1.0}
VIA = {"speed": 1.0, "acceleration": 2.0, "angular_acceleration": 3.0, "deviation": 0.05}
POINTS = np.array([[0, 0, 0], [1, 0.5, -0.3], [0.5, 1.5, 0], [-0.5, 0.7, 0.8], [0, 0, 1.0]])
ALONG = {"velocity": [1.0, 1.5, 1.0], "acceleration": [3.0, 2.0, 4.0], "jerk": [20.0, 30.0, 15.0]}
FILTER = {"dof": 2, "dt": 0.01, "velocity": 1.0, "acceleration": 1.0, "jerk": 1.0}
FAST = {"velocity": 1.0, "acceleration": 1.0}
A, B = (pin.SE3(pose.rotation, np.array([x, 0.0, 0.0])) for pose, x in zip(random_poses(5, 2), (0.0, 1.0), strict=True))
TURNED = pin.SE3(A.rotation @ pin.exp3(np.array([np.pi, 0.0, 0.0])), B.translation)
AXIS = [0.0, 0.0, 1.0]
VIAS = ((0.5, 0.0), (2.0, 0.0), (0.5, 1e-11), (0.0, 0.0), (1.0, 0.0))
BEYOND = Timing.identity(1.1), Timing.identity(0.5, start=-0.1), Timing([0.0, 2.0], [[-1.0], [2.5], [0.0]])
SHAPES = ([0.0, 1.0], [[0.0, 1.0]], [[], []], "here", [[0.0], [0.0, 1.0]], None)
FIRST, SECOND = (T.geodesic_path(*random_poses(seed, 2)) for seed in (0, 1))


def waves(x: float) -> Any:
    return [np.sin(60.0 * x)]


def later(value: object) -> Callable[[float], object]:
    return lambda x: value if x > 0.5 else [0.0]


#: (function, keyword arguments that are good, [(keyword arguments that are not, error, text)])
CHANGES: list[tuple[Any, dict[str, Any], list[tuple[dict[str, Any], type[WbcError], str]]]] = [
    (
        T.jerk_limited,
        JERK,
        [
            ({"velocity": 0.0}, RangeError, "limits.velocity"),
            ({"acceleration": [1.0, -1.0]}, RangeError, "limits.acceleration"),
            ({"jerk": INF}, NotFiniteError, "limits.jerk"),
            ({"jerk": NAN}, NotFiniteError, "limits.jerk"),
            ({"velocity": [1.0, 1.0, 1.0]}, ShapeError, "limits.velocity"),
            ({"start": [0.0, NAN]}, NotFiniteError, "start"),
            ({"start": [], "target": []}, ShapeError, "start"),
            ({"target": [0.0]}, ShapeError, "target"),
            ({"start_velocity": [0.0]}, ShapeError, "start_velocity"),
            ({"start_velocity": [0.0, 1.5]}, RangeError, "start_velocity"),
            ({"target_acceleration": [0.0, 1.5]}, RangeError, "target_acceleration"),
            ({"start_velocity": [0.0, 0.9], "start_acceleration": [0.0, 1.0]}, InfeasibleError, "start_velocity"),
            ({"target_velocity": [0.0, 0.9], "target_acceleration": [0.0, -1.0]}, InfeasibleError, "target_velocity"),
            ({"lower": 0.5, "upper": 3.0}, BoundsError, "start"),
            ({"upper": 1.5}, BoundsError, "target"),
            ({"lower": 1.0, "upper": -1.0}, BoundsError, "limits.lower"),
            ({"synchronisation": "tme"}, UnknownNameError, "synchronisation"),
            ({"synchronisation": "none", "target_velocity": [0.1, 0.0]}, RangeError, "synchronisation"),
            ({"straight": True, "start_velocity": [0.1, 0.1]}, ContinuityError, "start_velocity"),
        ],
    ),
    (
        T.jerk_limited_along,
        {"path": T.spline_path(POINTS), **ALONG},
        [
            ({"velocity": 0.0}, RangeError, "limits.velocity"),
            ({"jerk": [1.0, 1.0]}, ShapeError, "limits.jerk"),
            ({"acceleration": NAN}, NotFiniteError, "limits.acceleration"),
            ({"cells": 2}, RangeError, "cells"),
            ({"stops": "yes"}, ShapeError, "stops"),
            ({"path": POINTS}, ShapeError, "path"),
            ({"lower": -0.2, "upper": 2.0, "cells": 30}, BoundsError, "position of joint 0"),
        ],
    ),
    (
        T.time_optimal,
        {"path": LINE, **FAST},
        [
            ({"path": LINE * NAN}, NotFiniteError, "path.waypoints"),
            ({"path": LINE[0]}, ShapeError, "path.waypoints"),
            ({"path": "line"}, ShapeError, "path.waypoints"),
            ({"velocity": 0.0}, RangeError, "velocity"),
            ({"velocity": [1.0, -1.0]}, RangeError, "velocity"),
            ({"velocity": [1.0, NAN]}, RangeError, "velocity"),
            ({"acceleration": [1.0, 1.0, 1.0]}, ShapeError, "acceleration"),
            ({"acceleration": "much"}, ShapeError, "acceleration"),
            ({"acceleration": None}, RangeError, "path"),
            ({"acceleration": INF}, RangeError, "path"),
            ({"acceleration": [INF, 1.0], "path": [[0.0, 0.0], [1.0, 0.0]]}, RangeError, "path"),
            ({"limits": MotionLimits(velocity=np.ones(3))}, ShapeError, "limits"),
            ({"limits": MotionLimits(jerk=np.ones(2))}, RangeError, "limits.jerk"),
            ({"torque": 10.0}, ShapeError, "robot"),
            ({"cartesian_speed": {"tip": 1.0}}, ShapeError, "robot"),
            ({"inequality": (1, 2)}, ShapeError, "inequality"),
            ({"start_speed": -1.0}, RangeError, "start_speed"),
            ({"end_speed": NAN}, NotFiniteError, "end_speed"),
            ({"duration": 0.0}, RangeError, "duration"),
            ({"intervals": 1}, RangeError, "intervals"),
            ({"intervals": 10.5}, RangeError, "intervals"),
            ({"intervals": "many"}, ShapeError, "intervals"),
            ({"path": [[1.0], [1.0]], "end_speed": 0.1}, InfeasibleError, "end_speed"),
            ({"start_speed": 0.1, "duration": 5.0}, RangeError, "duration"),
            ({"path": [[0.0], [1.0]], "duration": 1.9}, InfeasibleError, "shortest that satisfies the limits is 2"),
        ],
    ),
    (
        T.online,
        FILTER,
        [
            ({"dt": 0.0}, RangeError, "dt"),
            ({"dof": 0}, RangeError, "dof"),
            ({"jerk": None}, ShapeError, "jerk"),
            ({"velocity": [1.0, INF]}, NotFiniteError, "velocity"),
            ({"synchronisation": "tim"}, UnknownNameError, "synchronisation"),
        ],
    ),
    (
        T.via_points,
        {"poses": [np.eye(4), pin.SE3(np.eye(3), np.array([0.1, 0.0, 0.0]))], **VIA},
        [
            *(
                ({name: value}, error, name)
                for name in (*VIA, "angular_speed")
                for value, error in (
                    (-1.0, RangeError),
                    (NAN, NotFiniteError),
                    ([1.0, 2.0], ShapeError),
                    ("a", ShapeError),
                )
            ),
            *(({name: 0.0}, RangeError, name) for name in (*VIA, "angular_speed") if name != "deviation"),
            ({"poses": []}, ShapeError, "poses"),
            ({"poses": [np.eye(4)]}, ShapeError, "poses"),
            ({"poses": 3}, ShapeError, "poses"),
            ({"poses": [np.eye(4), np.eye(3)]}, ShapeError, "poses[1]"),
            ({"poses": [np.eye(4), np.full((4, 4), NAN)]}, NotFiniteError, "poses[1]"),
            ({"poses": [2.0 * np.eye(4), np.eye(4)]}, RotationError, "poses[0]"),
            ({"poses": [np.eye(4), [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 2.0]]}, RotationError, "poses[1]"),
        ],
    ),
    (
        MotionLimits,
        {},
        [
            ({"velocity": [1.0, 0.0]}, RangeError, "limits.velocity"),
            ({"velocity": [1.0, -1.0]}, RangeError, "limits.velocity"),
            ({"acceleration": [1.0, NAN]}, ShapeError, "limits.acceleration"),
            ({"jerk": [[1.0]]}, ShapeError, "limits.jerk"),
            ({"jerk": "fast"}, ShapeError, "limits.jerk"),
            ({"velocity": [1.0], "jerk": [1.0, 2.0]}, ShapeError, "limits"),
            ({"lower": [0.0]}, ShapeError, "limits"),
            ({"lower": [0.0], "upper": [0.0]}, BoundsError, "limits.lower"),
            ({"lower": [0.0, 2.0], "upper": [1.0, 1.0]}, BoundsError, "limits.lower"),
            ({"lower": [NAN], "upper": [1.0]}, ShapeError, "limits.lower"),
        ],
    ),
    (
        PolynomialPath,
        {"knots": [0.0, 1.0], "coefficients": np.zeros((2, 1, 1))},
        [
            ({"knots": [0.0, 0.0]}, RangeError, "path.knots"),
            ({"knots": [0.0, 2.0, 1.0], "coefficients": np.zeros((2, 2, 1))}, RangeError, "path.knots"),
            ({"knots": [0.0], "coefficients": np.zeros((2, 0, 1))}, ShapeError, "path.knots"),
            ({"knots": [0.0, NAN]}, NotFiniteError, "path.knots"),
            *(
                ({"coefficients": np.zeros(shape)}, ShapeError, "path.coefficients")
                for shape in ((2, 2, 1), (2, 1), (0, 1, 1), (2, 1, 0))
            ),
            ({"coefficients": np.full((2, 1, 1), INF)}, NotFiniteError, "path.coefficients"),
        ],
    ),
    (
        Timing,
        {"times": [0.0, 1.0], "coefficients": np.zeros((2, 1))},
        [
            ({"times": [0.0, 1.0, 1.0], "coefficients": np.zeros((2, 2))}, RangeError, "timing.times"),
            ({"times": [0.0, 2.0, 1.0], "coefficients": np.zeros((2, 2))}, RangeError, "timing.times"),
            ({"times": [1.0, 2.0]}, RangeError, "timing.times"),
            ({"times": [0.0], "coefficients": np.zeros((2, 0))}, ShapeError, "timing.times"),
            ({"times": [[0.0, 1.0]]}, ShapeError, "timing.times"),
            ({"times": [0.0, NAN]}, NotFiniteError, "timing.times"),
            ({"times": [0.0, INF]}, NotFiniteError, "timing.times"),
            ({"times": "now"}, ShapeError, "timing.times"),
            *(({"coefficients": np.zeros(shape)}, ShapeError, "timing.coefficients") for shape in ((2, 2), 2, (0, 1))),
            ({"coefficients": [[NAN], [0.0]]}, NotFiniteError, "timing.coefficients"),
        ],
    ),
    (
        Timing.accelerations,
        {"s": np.array([0.0, 1.0]), "speed": np.array([1.0, 1.0])},
        [
            ({"speed": np.zeros(2)}, RangeError, "speed"),
            ({"speed": np.array([1.0, -0.5])}, RangeError, "speed"),
            ({"s": np.array([0.0, 1.0, 0.5]), "speed": np.ones(3)}, RangeError, "timing.s"),
            ({"s": np.zeros(2)}, RangeError, "timing.s"),
            ({"s": np.array([0.0, 1e-320]), "speed": np.array([0.1, 0.2])}, RangeError, "timing.s"),
            ({"s": np.array([0.0, 1.0, 1.0 + 2e-16]), "speed": np.array([0.1, 0.1, 0.9])}, RangeError, "timing.s"),
            ({"speed": np.ones(3)}, ShapeError, "speed"),
            ({"speed": np.array([1.0, NAN])}, NotFiniteError, "speed"),
        ],
    ),
    (
        smooth(1).sliced,
        {"start": 0.0, "end": 0.5},
        [
            ({"start": -0.1}, RangeError, "start"),
            ({"end": 1e9}, RangeError, "end"),
            ({"start": 0.5}, RangeError, "end"),
            ({"start": 0.5, "end": 0.1}, RangeError, "end"),
            ({"start": NAN}, NotFiniteError, "start"),
            ({"start": "a"}, ShapeError, "start"),
        ],
    ),
    (
        PolynomialPath.joined,
        {"paths": [smooth(1), smooth(1)]},
        [({"paths": bad}, ShapeError, "paths") for bad in (NAN, [], [smooth(1), smooth(2)], [smooth(1), 1.0])],
    ),
]

#: (call, error, text)
Case = tuple[Callable[[], Any], type[WbcError], str]


def each(values: Iterable[Any], call: Callable[[Any], Any], error: type[WbcError], text: str) -> list[Case]:
    return [(lambda value=value: call(value), error, text) for value in values]


BAD: list[Case] = [
    *each([[x, y, 0.0] for x, y in VIAS], lambda via: T.arc_through(A, via, B), RangeError, "path.via"),
    (lambda: T.arc_through(A, [0.5, 1.0, 0.0], A), RangeError, "path.via"),
    (lambda: T.arc_through(A, A.translation, A), RangeError, "the same"),
    (lambda: T.arc_through(A, [0.5, 1.0, 0.0], TURNED), RangeError, "half a turn"),
    (lambda: T.arc_through(A, "between", A), ShapeError, "path.via"),
    (lambda: T.arc_path(A, [0.0, 1.0], AXIS), ShapeError, "path.center"),
    (lambda: T.arc_path(A, [0.0, 1.0, 0.0], [0.0, NAN, 0.0]), NotFiniteError, "path.turn"),
    (lambda: T.arc_path(A, [0.0, 1.0, 0.0], AXIS, "free"), UnknownNameError, "carried"),
    *each([0.0, -1.0], lambda r: T.arc_path(A, [0.0, 1.0, 0.0], AXIS, radius=r), RangeError, "path.radius"),
    (lambda: T.arc_path(A, [0.0, 1e200, 0.0], [0.0, 0.0, 1e200]), RangeError, "at most 1e+60 in size"),
    *each([0.0, -1.0], lambda bad: T.blend_path(CORNER, bad), RangeError, "path.deviation"),
    (lambda: T.blend_path(CORNER, NAN), NotFiniteError, "path.deviation"),
    (lambda: T.function_path(waves, 0.0, 1.0, 1e-9, intervals=63), ContinuityError, "with 32 intervals, off by"),
    *each([NAN, INF, -INF], lambda x: T.function_path(later([x]), 0.0, 1.0), NotFiniteError, "path.function(0.5625)"),
    (lambda: T.function_path(later([0.0, 0.0]), 0.0, 1.0), ShapeError, "path.function(0.5625)"),
    *each(
        [1.0, [], [[1.0]], "a", None],
        lambda bad: T.function_path(lambda x: bad, 0.0, 1.0),
        ShapeError,
        "path.function(0)",
    ),
    (lambda: T.function_path([0.0, 1.0], 0.0, 1.0), ShapeError, "path.function"),
    *each([1.0, 0.0], lambda end: T.function_path(waves, 1.0, end), RangeError, "path.end"),
    (lambda: T.function_path(waves, NAN, 1.0), NotFiniteError, "path.start"),
    (lambda: T.function_path(waves, 0.0, 1.0, 0.0), RangeError, "path.tolerance"),
    (lambda: T.function_path(waves, 0.0, 1.0, intervals=8), RangeError, "path.intervals"),
    *each(SHAPES, T.spline_path, ShapeError, "path.waypoints"),
    *each(SHAPES, lambda bad: T.blend_path(bad, 0.1), ShapeError, "path.waypoints"),
    *each([[[0.0], [x]] for x in (NAN, INF)], T.spline_path, NotFiniteError, "path.waypoints"),
    *each([[[0.0], [x]] for x in (NAN, INF)], lambda bad: T.blend_path(bad, 0.1), NotFiniteError, "path.waypoints"),
    (lambda: T.spline_path([[-1.7e308], [1.7e308]]), RangeError, "at most 1e+60 in size"),
    (lambda: T.blend_path([[-1.7e308], [1.7e308]], 0.1), RangeError, "at most 1e+60 in size"),
    (lambda: T.spline_path(LINE, "periodic"), UnknownNameError, "not-a-knot"),
    (lambda: T.straight_path(1.0, 2.0), ShapeError, "path.start"),
    (lambda: T.straight_path([1.0], [1.0, 2.0]), ShapeError, "path.end"),
    (lambda: T.straight_path([1.0], [NAN]), NotFiniteError, "path.end"),
    *each([1.0, [], [[1.0]]], T.standing_path, ShapeError, "path.position"),
    *each([[0.0, NAN], [0.0, INF]], smooth(1).at, NotFiniteError, "t: "),
    *each([[0.0, NAN], [0.0, INF]], smooth(1).jerk, NotFiniteError, "t: "),
    *each([smooth(1).at, smooth(1).jerk], lambda call: call([0.0, "soon"]), ShapeError, "t: "),
    *each([0.0, -1.0], smooth(1).scaled, RangeError, "factor"),
    *each([NAN, INF], smooth(1).scaled, NotFiniteError, "factor"),
    *each([[1.0]], smooth(1).scaled, ShapeError, "factor"),
    *each(BEYOND, lambda timing: Law(UNIT, timing), RangeError, "law.timing"),
    (lambda: Law(UNIT, Timing.identity(1.0), MotionLimits(velocity=np.ones(2))), ShapeError, "limits"),
    (lambda: MotionLimits(velocity=[1.0, 2.0]).for_dof(3), ShapeError, "limits"),
    (lambda: JoinedPath(*(PolynomialPath([0.0, 1.0], np.zeros((1, 1, n))) for n in (1, 2))), ShapeError, "path"),
    *each([0.0, -1.0], Timing.identity, RangeError, "timing.times"),
    *each([NAN, INF], Timing.identity, NotFiniteError, "timing.times"),
    *each([[], POSES[:1], 3.0], lambda bad: T.pose_polyline(bad, 0.1), ShapeError, "path.poses"),
    *each(["there", np.zeros((3, 3))], lambda bad: T.pose_polyline([POSES[0], bad], 0.1), ShapeError, "path.poses"),
    (lambda: T.geodesic_path(POSES[0], [NAN, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0]), NotFiniteError, "path.poses[1]"),
    (lambda: T.geodesic_path(POSES[0], 2.0 * np.eye(4)), RotationError, "path.poses[1]"),
    (lambda: T.pose_polyline(POSES[:2], 0.0, 0.1, 0.5), RangeError, "path.deviation:"),
    (lambda: T.pose_polyline(POSES[:2], 0.1, -1.0, 0.5), RangeError, "path.turn_deviation:"),
    (lambda: T.pose_polyline(POSES[:2], 0.1, 0.1, 0.0), RangeError, "path.radius:"),
    (lambda: T.geodesic_path(POSES[0], HALF), RangeError, "too far from the orientation before it"),
    (lambda: PosePath(FIRST.position, SECOND.turning), RangeError, "same knots"),
    (lambda: PosePath(FIRST, FIRST.turning), ShapeError, "dof 3"),
    (lambda: T.pose_spline(POSES, "free"), UnknownNameError, "natural"),
    (lambda: T.pose_spline(POSES[:1]), ShapeError, "path.poses"),
    (lambda: T.pose_spline(POSES, radius=0.0), RangeError, "path.radius"),
    (lambda: T.pose_spline([POSES[0], FAR, POSES[2]]), RangeError, "path.poses[1]: "),
    (lambda: T.pose_spline([POSES[0], FAR, POSES[2]]), RangeError, "at most 170 deg"),
]
BAD += [(lambda f=f, k=good | change: f(**k), error, text) for f, good, them in CHANGES for change, error, text in them]


@pytest.mark.parametrize(("call", "error", "text"), BAD, ids=range(len(BAD)))
def test_bad_input_is_refused_by_name(call: Callable[[], Any], error: type[WbcError], text: str) -> None:
    assert_refused(call, error, text)
