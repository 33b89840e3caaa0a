"""The reference of the angle of an arm's plane, full turns of the self-motion, and limits of the angle."""

from __future__ import annotations

import functools
from dataclasses import replace

import casadi as ca
import numpy as np
import pinocchio as pin
import pytest

from tests.tasks.planes import (
    LIMIT,
    SPHERICAL,
    TILTED,
    clear,
    evaluate,
    robot,
    seen,
    states,
    wrap,
)
from wbc.tasks import _stereographic as stereo
from wbc.tasks.pitch_plane_limit import PitchPlaneLimit


@functools.cache
def coordinates() -> ca.Function:
    u, d = ca.SX.sym("u", 3), ca.SX.sym("d", 3)
    return ca.Function("c", [u, d], list(stereo.coordinates(u, d, TILTED)))


def field(line: np.ndarray) -> np.ndarray:
    """a(u) of the expressions under test, from the coordinates of a direction across the line."""
    first = np.cross(line, [0.1, 0.7, -0.4])
    first /= np.linalg.norm(first)
    x, y = (float(c) for c in coordinates()(line, first))
    across = np.cross(line, first)
    return (x * first - y * across) / np.hypot(x, y)


def sphere(count: int, seed: int) -> np.ndarray:
    points = np.random.default_rng(seed).normal(size=(count, 3))
    return points / np.linalg.norm(points, axis=1)[:, None]


def test_reference_is_the_stereographic_one() -> None:
    """((u - e_t) x e_r) x u of Elias and Wen with e_t = -pole, e_r = direction, up to length."""
    for line in sphere(100, 7):
        theirs = np.cross(np.cross(line + np.array(TILTED.pole), TILTED.direction), line)
        np.testing.assert_allclose(field(line), theirs / np.linalg.norm(theirs), atol=1e-12)


def euler_zyz(rotation: np.ndarray) -> np.ndarray:
    second = np.arctan2(np.hypot(rotation[0, 2], rotation[1, 2]), rotation[2, 2])
    return np.array([np.arctan2(rotation[1, 2], rotation[0, 2]), second, np.arctan2(rotation[2, 1], -rotation[2, 0])])


def self_motion(q: np.ndarray, turn: float) -> np.ndarray:
    """The spherical arm with its elbow turned about the shoulder-wrist line, hand kept."""
    model = robot("spherical").model
    data = model.createData()
    pin.framesForwardKinematics(model, data, q)
    wrist, hand = data.oMi[5].translation, data.oMi[7].rotation
    arm = pin.AngleAxis(turn, wrist / np.linalg.norm(wrist)).matrix() @ data.oMi[3].rotation
    lower = arm @ pin.rpy.rpyToMatrix(0.0, q[3], 0.0)
    return np.concatenate([euler_zyz(arm), [q[3]], euler_zyz(lower.T @ hand)])


@pytest.mark.parametrize("seed", range(5))
def test_full_turn_of_the_self_motion(seed: int) -> None:
    """psi follows the elbow's turn exactly, through +-pi, and the error passes its target smoothly."""
    q = clear("spherical", SPHERICAL, 1, seed=seed + 20)[0]
    model = robot("spherical").model
    data = model.createData()
    tip = model.getFrameId("tip")
    pin.framesForwardKinematics(model, data, q)
    pose = data.oMf[tip].copy()
    start, last, total = SPHERICAL.angle(robot("spherical"), q), None, 0.0
    rows = []
    for turn in np.linspace(0, 2 * np.pi, 73):
        moved = self_motion(q, turn)
        pin.framesForwardKinematics(model, data, moved)
        assert np.linalg.norm(pin.log6(pose.actInv(data.oMf[tip])).vector) < 1e-12
        error, jacobian, factor = evaluate("spherical", SPHERICAL, moved)
        assert factor[0] == 1.0
        assert wrap(error[0] - start - turn) == pytest.approx(0, abs=1e-12)
        around = evaluate("spherical", SPHERICAL, moved, np.pi)
        assert wrap(around[0][0] - error[0] + np.pi) == pytest.approx(0, abs=1e-12)
        np.testing.assert_allclose(around[1], jacobian, atol=1e-9)
        if last is not None:
            assert wrap(error[0] - last) > 0
            total += wrap(error[0] - last)
        last = error[0]
        rows.append(jacobian)
    assert total == pytest.approx(2 * np.pi, abs=1e-12)
    np.testing.assert_allclose(rows[0], rows[-1], atol=1e-9)


LIMITS: dict[str, tuple[str, PitchPlaneLimit]] = {
    "panda": ("panda", PitchPlaneLimit("panda_link2", "panda_link4", "panda_link6", lower=-1.0, upper=0.2)),
    "spherical": ("spherical", LIMIT),
    "range across pi": ("spherical", replace(LIMIT, lower=2.5, upper=4.0)),
    "axis": ("ssrms", PitchPlaneLimit("F3", "F4", "F5", axis="joint3", lower=-1.0, upper=1.0)),
}


@pytest.mark.parametrize("case", LIMITS)
def test_margins_are_the_distances_to_the_bounds(case: str) -> None:
    name, item = LIMITS[case]
    for q in clear(name, item, 20, seed=14):
        middle, half = (item.lower + item.upper) / 2, (item.upper - item.lower) / 2
        off = wrap(seen(name, item, q).psi - middle)
        np.testing.assert_allclose(evaluate(name, item, q)[0], [half + off, half - off], atol=1e-11)


@pytest.mark.parametrize("case", LIMITS)
def test_margin_derivative_includes_the_fading(case: str) -> None:
    """Central differences of the margins themselves, at random states and inside the faded zones."""
    name, item = LIMITS[case]
    model = robot(name).model
    states_here = list(states(name, 10, seed=15))
    if name == "spherical":
        states_here += [np.array([0.3, 0.9, 0.2, bend, 0.4, 0.5, 0.6]) for bend in (0.05, 0.1, 0.15, 0.2)]
        assert 0.0 < evaluate(name, item, states_here[-2])[2][0] < 1.0
    for q in states_here:
        jacobian = evaluate(name, item, q)[1]
        for k, direction in enumerate(1e-6 * np.eye(model.nv)):
            change = evaluate(name, item, q + direction)[0] - evaluate(name, item, q - direction)[0]
            np.testing.assert_allclose(jacobian[:, k], change / 2e-6, atol=1e-6 * (1 + np.abs(jacobian).max() ** 2))
