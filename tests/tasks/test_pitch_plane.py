"""PitchPlane and PitchPlaneLimit against an independent angle built from Pinocchio's poses.

The referee uses the shortest rotation from the pole to the line as a quaternion, not the reflections of the
expressions under test.
"""

from __future__ import annotations

import functools
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import casadi as ca
import numpy as np
import pinocchio as pin
import pytest

import wbc.robots
from tests import models
from wbc.errors import BoundsError, NotFiniteError, RangeError, ShapeError, UnknownNameError
from wbc.robot import Robot
from wbc.symbolic import Kinematics, Tracer
from wbc.tasks import _stereographic as stereo
from wbc.tasks._plane import PlaneItem
from wbc.tasks._stereographic import PlaneReference
from wbc.tasks.pitch_plane import PitchPlane
from wbc.tasks.pitch_plane_limit import PitchPlaneLimit

TILTED = PlaneReference(pole=(0.3, -0.2, 0.9), direction=(1.0, 0.5, 0.0))


def equal_arm() -> Robot:
    """Equal links, so that the wrist can reach the shoulder."""
    return models.spherical_seven(0.4, 0.4)


def unequal_arm() -> Robot:
    """A short forearm, so that the folded arm's wrist stays away from the shoulder."""
    return models.spherical_seven(0.42, 0.25)


ROBOTS: dict[str, Callable[[], Robot]] = {
    "panda": lambda: wbc.robots.load("panda"),
    "spherical": models.spherical_seven,
    "equal": equal_arm,
    "unequal": unequal_arm,
    "four": models.four_joint_arm,
    "ssrms": models.ssrms,
    "talos": lambda: wbc.robots.load("talos"),
}
PANDA = PitchPlane("panda_link2", "panda_link4", "panda_link6")
SPHERICAL = PitchPlane("F1", "F4", "F5")
OFFSET = PitchPlane("F3", "F4", "F5")
TALOS = PitchPlane("arm_left_2_link", "arm_left_4_link", "arm_left_6_link", base="torso_2_link")
CASES: dict[str, tuple[str, PitchPlane]] = {
    "panda": ("panda", PANDA),
    "panda, tilted reference": ("panda", replace(PANDA, reference=TILTED)),
    "panda, point on a link": ("panda", replace(PANDA, elbow_offset=(0.05, -0.1, 0.02))),
    "panda, axis": ("panda", replace(PANDA, axis="panda_joint4", reference=TILTED)),
    "spherical": ("spherical", SPHERICAL),
    "lateral offsets": ("ssrms", OFFSET),
    "lateral offsets, axis": ("ssrms", replace(OFFSET, axis="joint3", reference=PlaneReference())),
    "lateral offsets, axis, base": ("ssrms", replace(OFFSET, axis="joint3", reference=TILTED, base="F1")),
    "floating base": ("talos", TALOS),
    "floating base in the world": ("talos", replace(TALOS, base="world", reference=TILTED)),
}


@functools.cache
def robot(name: str) -> Robot:
    return ROBOTS[name]()


@functools.cache
def compiled(name: str, item: PlaneItem) -> ca.Function:
    """(q, target) -> value, Jacobian, factor; value is the error of a task or the margins of a limit."""
    item.validate(robot(name))
    kin, target = Tracer(Kinematics(robot(name).model)), ca.SX.sym("target")
    given = {"target": target}
    own = None
    if isinstance(item, PitchPlane):
        value = item.error(robot(name), kin, given)
        own = item.jacobian(robot(name), kin, given)
    else:
        assert isinstance(item, PitchPlaneLimit)
        value = item.margins(robot(name), kin, given)
    jacobian = kin.jacobian(value) if own is None else kin.expand(own)
    drift = ca.jacobian(value, target)
    factor = item.row_factor(robot(name), kin, given)
    outputs = [kin.expand(value), ca.densify(jacobian), kin.expand(factor), kin.expand(ca.densify(drift))]
    return ca.Function("item", [kin.q, target], ca.cse(outputs))


def evaluate(name: str, item: PlaneItem, q: np.ndarray, target: float = 0.0) -> tuple[np.ndarray, ...]:
    value, jacobian, factor, _ = compiled(name, item)(q, target)
    return np.array(value).ravel(), np.array(jacobian), np.array(factor).ravel()


def wrap(angle: float) -> float:
    return float(np.arctan2(np.sin(angle), np.cos(angle)))


@dataclass
class Seen:
    """The plane of an arm from Pinocchio's poses, base axes."""

    line: np.ndarray
    direction: np.ndarray
    psi: float


def shortest(pole: np.ndarray, line: np.ndarray) -> np.ndarray:
    return pin.Quaternion.FromTwoVectors(pole, line).matrix()


def seen(name: str, item: PlaneItem, q: np.ndarray) -> Seen:
    model = robot(name).model
    data = model.createData()
    pin.framesForwardKinematics(model, data, q)
    named = ((item.shoulder, item.shoulder_offset), (item.elbow, item.elbow_offset), (item.wrist, item.wrist_offset))
    s, e, w = (data.oMf[model.getFrameId(f)].act(np.array(o)) for f, o in named)
    line, direction = w - s, e - s
    if item.axis is not None:
        joint = model.getJointId(item.axis)
        motion = data.oMi[joint].act(pin.Motion(np.array(model.joints[joint].createData().S).ravel()))
        axis = motion.angular
        line = line - axis * (axis @ line)
        direction = np.cross(line, axis)
    if item.base != "world":
        turn = data.oMf[model.getFrameId(item.base)].rotation.T
        line, direction = turn @ line, turn @ direction
    line = line / np.linalg.norm(line)
    reference = item.reference if item.reference is not None else PlaneReference()
    zero = shortest(np.array(reference.pole), line) @ np.array(reference.direction)
    psi = np.arctan2(line @ np.cross(zero, direction), zero @ direction)
    return Seen(line, direction, float(psi))


def states(name: str, count: int, seed: int = 0) -> np.ndarray:
    """Random configurations, joints within +-pi, floating base anywhere."""
    model = robot(name).model
    rng = np.random.default_rng(seed)
    tangent = rng.uniform(-np.pi, np.pi, (count, model.nv))
    return np.array([pin.integrate(model, pin.neutral(model), t) for t in tangent])


def clear(name: str, item: PlaneItem, count: int, seed: int = 0) -> list[np.ndarray]:
    """Random configurations where nothing fades."""
    found = [q for q in states(name, 8 * count, seed) if evaluate(name, item, q)[2].min() == 1.0]
    assert len(found) >= count
    return found[:count]


def angle_differs(name: str, item: PlaneItem) -> float:
    """Largest difference between the angle under test and the referee's."""
    out = 0.0
    for q in clear(name, item, 20, seed=1):
        for target in (0.0, 1.3, -3.0):
            got = evaluate(name, item, q, target)[0][0]
            assert -np.pi <= got <= np.pi
            out = max(out, abs(wrap(got - seen(name, item, q).psi + target)))
    return out


@pytest.mark.parametrize("case", CASES)
def test_angle_is_that_of_pinocchio(case: str) -> None:
    name, item = CASES[case]
    assert angle_differs(name, item) < 1e-11
    q = clear(name, item, 1, seed=2)[0]
    assert item.angle(robot(name), q) == pytest.approx(seen(name, item, q).psi, abs=1e-12)
    assert item.initial(robot(name), q) == {"target": item.angle(robot(name), q)}


def test_a_mutated_formula_is_noticed(monkeypatch: pytest.MonkeyPatch) -> None:
    """The angle check fails for a conventional reference in the place of the stereographic one."""

    def conventional(line: ca.SX, direction: ca.SX, reference: PlaneReference) -> tuple[ca.SX, ca.SX]:
        normal = ca.cross(line, ca.DM(reference.pole))
        return ca.dot(ca.cross(normal, line), direction), ca.dot(normal, direction)

    monkeypatch.setattr(stereo, "coordinates", conventional)
    compiled.cache_clear()
    try:
        assert angle_differs("panda", PANDA) > 0.1
    finally:
        compiled.cache_clear()


@pytest.mark.parametrize("case", CASES)
def test_jacobian_is_the_derivative(case: str) -> None:
    """Against central differences of the referee's angle along every degree of freedom."""
    name, item = CASES[case]
    model, step = robot(name).model, 1e-5
    for q in clear(name, item, 5, seed=3):
        _, jacobian, _ = evaluate(name, item, q)
        for k, direction in enumerate(np.eye(model.nv)):
            ahead = seen(name, item, pin.integrate(model, q, step * direction)).psi
            behind = seen(name, item, pin.integrate(model, q, -step * direction)).psi
            want = wrap(ahead - behind) / (2 * step)
            assert jacobian[0, k] == pytest.approx(want, abs=2e-7 * (1 + np.abs(jacobian).max() ** 3))
        assert float(compiled(name, item)(q, 0.7)[3]) == pytest.approx(-1.0, abs=1e-14)


def test_angle_in_a_moving_base_ignores_the_base() -> None:
    """Seen from the torso, neither the floating base nor the other joints turn the plane."""
    arm = [k for k, n in enumerate(robot("talos").dof_names) if n.startswith("arm_left")]
    for q in clear("talos", TALOS, 5, seed=4):
        rest = np.delete(evaluate("talos", TALOS, q)[1], arm)
        assert np.abs(rest).max() < 1e-12
    rate = replace(TALOS, axis="arm_left_4_joint")
    for q in clear("talos", rate, 5, seed=4):
        np.testing.assert_array_equal(np.delete(evaluate("talos", rate, q)[1], arm), np.zeros(len(q) - 1 - len(arm)))


# --- the reference ---------------------------------------------------------------------------------


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


def test_reference_is_continuous_away_from_one_half_line() -> None:
    """|da| <= |du| / cos(theta / 2), theta the angle to the pole: bounded on the sphere without -pole."""
    pole, step = np.array(TILTED.pole), 1e-5
    spread = np.random.default_rng(5).normal(size=(300, 3))
    lines = [*sphere(250, 6), *(pole + 1e-3 * s for s in spread[:50])]
    largest = 0.0
    for line, other in zip(lines, spread, strict=True):
        line = line / np.linalg.norm(line)
        near = line + step * other
        near /= np.linalg.norm(near)
        theta = np.arccos(np.clip(pole @ line, -1, 1))
        if theta > 0.97 * np.pi:
            continue
        change = np.linalg.norm(field(near) - field(line)) / np.linalg.norm(near - line)
        largest = max(largest, change * np.cos(theta / 2))
        assert abs(field(line) @ line) < 1e-12
    assert 0.9 < largest < 1.01


def test_reference_turns_twice_round_the_half_line_and_not_round_the_pole() -> None:
    """The index of the singular direction -pole is 2, all that a field on the sphere must have; at +pole it is 0."""
    pole, side = np.array(TILTED.pole), np.array(TILTED.direction)
    up = np.cross(pole, side)
    for centre, turns in ((-pole, 2), (pole, 0)):
        last, total = None, 0.0
        for t in np.linspace(0, 2 * np.pi, 201):
            line = centre + 1e-3 * (np.cos(t) * side + np.sin(t) * up)
            line /= np.linalg.norm(line)
            a = field(line)
            now = np.arctan2(a @ up, a @ side)
            total += 0.0 if last is None else wrap(now - last)
            last = now
        assert abs(total) == pytest.approx(2 * np.pi * turns, abs=1e-6)


def test_reference_is_the_stereographic_one() -> None:
    """((u - e_t) x e_r) x u of Elias and Wen with e_t = -pole, e_r = direction, up to length."""
    for line in sphere(100, 7):
        theirs = np.cross(np.cross(line + np.array(TILTED.pole), TILTED.direction), line)
        np.testing.assert_allclose(field(line), theirs / np.linalg.norm(theirs), atol=1e-12)


# --- self-motion -----------------------------------------------------------------------------------


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


# --- the axis form ---------------------------------------------------------------------------------


def test_axis_and_points_agree_where_the_arm_is_planar() -> None:
    """Panda: shoulder, elbow and wrist lie in the plane perpendicular to joint 4, so the angles differ by 0 or pi."""
    axis = replace(PANDA, axis="panda_joint4", reference=PlaneReference())
    for q in clear("panda", axis, 20, seed=8):
        if evaluate("panda", PANDA, q)[2][0] < 1.0:
            continue
        off = evaluate("panda", axis, q)[0][0] - evaluate("panda", PANDA, q)[0][0]
        assert abs(np.sin(off)) < 1e-11


def test_axis_form_points_to_the_elbow() -> None:
    """Arm without offsets: the two angles are equal for a positive elbow angle, opposite for a negative one."""
    points = PitchPlane("F3", "F4", "tip")
    axis = replace(points, axis="joint3", reference=PlaneReference())
    for q in clear("four", points, 20, seed=18):
        off = wrap(evaluate("four", axis, q)[0][0] - evaluate("four", points, q)[0][0])
        assert abs(off) == pytest.approx(0.0 if q[3] > 0 else np.pi, abs=1e-11)


@pytest.mark.parametrize(
    ("name", "item"),
    [
        ("panda", replace(PANDA, axis="panda_joint4")),
        ("ssrms", replace(OFFSET, axis="joint3")),
        ("ssrms", replace(OFFSET, axis="joint3", base="F1")),
    ],
    ids=str,
)
def test_angle_rate_is_alpha_and_the_transport_of_the_reference(name: str, item: PitchPlane) -> None:
    """d psi / dt = alpha + p.(u x du/dt) / (1 + p.u)."""
    model, step = robot(name).model, 1e-6
    angled = replace(item, reference=TILTED)
    pole = np.array(TILTED.pole)
    for q, v in zip(clear(name, angled, 10, seed=9), np.random.default_rng(9).normal(size=(10, model.nv)), strict=True):
        line = seen(name, angled, q).line
        ahead = seen(name, angled, pin.integrate(model, q, step * v)).line
        behind = seen(name, angled, pin.integrate(model, q, -step * v)).line
        transport = pole @ np.cross(line, ahead - behind) / (2 * step) / (1 + pole @ line)
        alpha = (evaluate(name, item, q)[1] @ v).item()
        psi = (evaluate(name, angled, q)[1] @ v).item()
        assert psi == pytest.approx(alpha + transport, abs=1e-7)


def test_alpha_is_no_derivative() -> None:
    """Round a closed loop of joint angles the angle returns, the integral of alpha does not (Gauss-Bonnet)."""
    item = replace(OFFSET, axis="joint3")
    centre = np.array([0.3, 0.4, -0.5, 1.2, 0.7, -0.6, 0.9])
    total, count = 0.0, 2000
    for t in 2 * np.pi * (np.arange(count) + 0.5) / count:
        q, v = centre.copy(), np.zeros(7)
        q[0] += 0.5 * np.cos(t)
        q[2] += 0.5 * np.sin(t)
        v[0], v[2] = -0.5 * np.sin(t), 0.5 * np.cos(t)
        total += (evaluate("ssrms", item, q)[1] @ v).item() * 2 * np.pi / count
    assert abs(total) > 0.05


def test_rate_form_counts_from_the_present_plane() -> None:
    item = replace(OFFSET, axis="joint3")
    assert item.commands_rate
    target, feedforward = item.inputs(robot("ssrms"))
    assert (target.default, target.rate, feedforward.default) == (0.0, "feedforward", 0.0)
    assert item.initial(robot("ssrms"), np.zeros(7)) == {}
    for q in clear("ssrms", item, 3):
        value, _, _, drift = compiled("ssrms", item)(q, 0.25)
        assert float(value) == -0.25
        assert float(drift) == -1.0


# --- singular sets ---------------------------------------------------------------------------------

#: name of the robot, item, configuration exactly on a singular set, direction that leaves it
SINGULAR: dict[str, tuple[str, PlaneItem, list[float], list[float]]] = {
    "straight arm": ("spherical", SPHERICAL, [0.3, 0.9, 0.2, 0, 0.4, 0.5, 0.6], [0, 0, 0, 1, 0, 0, 0]),
    "folded arm": ("unequal", SPHERICAL, [0.3, 0.9, 0.2, np.pi, 0.4, 0.5, 0.6], [0, 0, 0.2, 1, 0, 0, 0]),
    "wrist at shoulder": ("equal", SPHERICAL, [0.3, 0.9, 0.2, np.pi, 0.4, 0.5, 0.6], [0, 0.3, 0, 1, 0, 0, 0]),
    "straight down": ("spherical", SPHERICAL, [0, np.pi, 0, 0, 0, 0, 0], [0, 1, 0, 0.7, 0, 0, 0]),
    "all zero": ("spherical", SPHERICAL, [0] * 7, [0, 0.2, 0, 1, 0, 0, 0]),
    "half-line": ("equal", SPHERICAL, [0.4, np.pi - 0.5, 0, 1, 0, 0, 0], [0.1, 1, 0.3, 0, 0, 0, 0]),
    "pitch axes coaxial": (
        "ssrms",
        replace(OFFSET, axis="joint3"),
        [0.3, 0.4, -0.5, np.pi, 0.7, -0.6, 0.9],
        [0, 0, 0.3, 1, 0, 0, 0],
    ),
    "pitch axes coaxial, angle": (
        "ssrms",
        replace(OFFSET, axis="joint3", reference=TILTED),
        [0.3, 0.4, -0.5, np.pi, 0.7, -0.6, 0.9],
        [0, 0, 0.3, 1, 0, 0, 0],
    ),
    "limit, straight arm": (
        "spherical",
        PitchPlaneLimit("F1", "F4", "F5", lower=-1, upper=2),
        [0.3, 0.9, 0.2, 0, 0.4, 0.5, 0.6],
        [0, 0, 0, 1, 0, 0, 0],
    ),
    "limit, half-line": (
        "equal",
        PitchPlaneLimit("F1", "F4", "F5", lower=-1, upper=2),
        [0.4, np.pi - 0.5, 0, 1, 0, 0, 0],
        [0.1, 1, 0.3, 0, 0, 0, 0],
    ),
}


@pytest.mark.parametrize("case", SINGULAR)
def test_nothing_breaks_on_a_singular_set(case: str) -> None:
    """Finite values and derivatives on the set and at every distance from it; the row is off on the set."""
    name, item, q, direction = SINGULAR[case]
    q, direction = np.array(q, dtype=float), np.array(direction, dtype=float)
    value, jacobian, factor = evaluate(name, item, q)
    assert (factor == 0.0).all()
    if isinstance(item, PitchPlaneLimit):
        np.testing.assert_allclose(value, 1.5)
        np.testing.assert_array_equal(jacobian, np.zeros((2, 7)))
    for distance in [0.0, *np.logspace(-300, 0, 301)]:
        for part in evaluate(name, item, q + distance * direction, 0.4):
            assert np.isfinite(part).all()


@pytest.mark.parametrize("case", SINGULAR)
def test_fading_is_smooth(case: str) -> None:
    """Along a line through the set: 0 on it, 1 far off, monotone between, no jump in the first two derivatives."""
    name, item, q, direction = SINGULAR[case]
    q, direction = np.array(q, dtype=float), np.array(direction, dtype=float)
    jumps = []
    for count in (4000, 8000):
        distances = np.linspace(-1.2, 1.2, count + 1)
        moved = np.stack([q + t * direction for t in distances], axis=1)
        function = compiled(name, item)
        factor = np.array(function.map(count + 1)(moved, np.zeros((1, count + 1)))[2])
        factor = factor.reshape(-1, order="F")[:: 2 if isinstance(item, PitchPlaneLimit) else 1]
        assert ((factor >= 0) & (factor <= 1)).all()
        step = distances[1] - distances[0]
        first = np.diff(factor) / step
        second = np.diff(first) / step
        jumps.append((np.abs(np.diff(first)).max(), np.abs(np.diff(second)).max()))
        assert factor[count // 2] == 0.0
        assert factor.max() == 1.0
    # A jump would stay when the step is halved; a continuous derivative's differences halve with it
    assert jumps[1][0] < 0.6 * jumps[0][0]
    assert jumps[1][1] < 0.7 * jumps[0][1]


@pytest.mark.parametrize("case", [c for c in SINGULAR if not c.startswith("limit")])
def test_faded_curvature_goes_to_zero(case: str) -> None:
    """factor J'J, what the row adds to the Hessian, is bounded and vanishes towards the set, though J grows."""
    name, item, q, direction = SINGULAR[case]
    q, direction = np.array(q, dtype=float), np.array(direction, dtype=float)
    rows = [evaluate(name, item, q + t * direction) for t in np.logspace(-9, np.log10(0.4), 600)]
    added = np.array([f[0] * (j @ j.T).item() for _, j, f in rows])
    plain = max((j @ j.T).item() for _, j, f in rows if f[0] == 1.0)
    assert added[:5].max() == 0.0
    assert added.max() < 4 * plain
    assert added[np.flatnonzero(added)[0]] < 1e-3 * plain


def share_clear(item: PitchPlane) -> float:
    """Share of 500 uniform states within the Panda's limits where the row has its full weight."""
    limits = robot("panda").limits
    within = np.random.default_rng(11).uniform(limits.position_lower, limits.position_upper, (500, 7))
    return float(np.mean([evaluate("panda", item, q)[2][0] == 1.0 for q in within]))


def test_panda_elbow_that_crosses_the_line() -> None:
    """Link 4 crosses the shoulder-wrist line at q4 = -(atan(0.0825 / 0.316) + atan(0.0825 / 0.384)), inside the limits.

    There the three-point plane is undefined; link 3, on the upper arm's axis, and the axis form have no such state.
    """
    crossing = -(np.arctan(0.0825 / 0.316) + np.arctan(0.0825 / 0.384))
    assert robot("panda").limits.position_lower[3] < crossing < robot("panda").limits.position_upper[3]
    q = np.array([0.2, 0.4, -0.3, crossing, 0.1, 1.2, 0.5])
    beyond = q + [0, 0, 0, 0.3, 0, 0, 0]
    before = q - [0, 0, 0, 0.3, 0, 0, 0]
    straight = replace(PANDA, elbow="panda_link3")
    axis = replace(PANDA, axis="panda_joint4", reference=PlaneReference())
    assert evaluate("panda", PANDA, q)[2][0] == 0.0
    assert abs(wrap(evaluate("panda", PANDA, beyond)[0][0] - evaluate("panda", PANDA, before)[0][0])) > 2.0
    for item in (straight, axis):
        assert evaluate("panda", item, q)[2][0] == 1.0
        assert abs(wrap(evaluate("panda", item, beyond)[0][0] - evaluate("panda", item, before)[0][0])) < 0.5
    assert 0.85 < share_clear(PANDA) < 0.92
    assert share_clear(straight) > 0.95
    assert share_clear(axis) > 0.99


# --- closed loop -----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "item"),
    [
        ("panda", PANDA),
        ("spherical", SPHERICAL),
        ("ssrms", OFFSET),
        ("ssrms", replace(OFFSET, axis="joint3", reference=TILTED)),
    ],
    ids=str,
)
def test_closed_loop_from_random_starts(name: str, item: PitchPlane) -> None:
    """100 random starts: v = J' wish, damped and faded as in the tick; psi measured with Pinocchio's poses."""
    dt, gain, count = 0.01, 2.0, 100
    starts = states(name, count, seed=12).T
    targets = np.random.default_rng(13).uniform(-np.pi, np.pi, (1, count))
    rows = compiled(name, item).map(count)
    q, begin, worst = starts.copy(), None, np.ones(count)
    for _ in range(400):
        error, jacobian, factor, _ = (np.array(o) for o in rows(q, targets))
        jacobian = jacobian.reshape(count, -1)
        begin = error.ravel() if begin is None else begin
        worst = np.minimum(worst, factor.ravel())
        size = factor.ravel() * (jacobian**2).sum(axis=1)
        speed = -gain * error.ravel() * factor.ravel() / (size + 1e-8)
        q = q + dt * (speed[:, None] * jacobian).T
    left = np.array([wrap(seen(name, item, q[:, k]).psi - targets[0, k]) for k in range(count)])
    # Starts that never came near a singular set: exponential decay, the first step's curvature aside
    good = worst == 1.0
    assert good.sum() > 50
    assert np.abs(left[good]).max() < 3e-3
    np.testing.assert_array_less(np.abs(left[good]), np.abs(begin[good]) * np.exp(-gain * 400 * dt) * 1.5 + 1e-9)
    # Through a faded zone it is slower, and nothing blows up
    assert np.isfinite(q).all()
    assert np.mean(np.abs(left) < 3e-3) > 0.8


# --- the limit -------------------------------------------------------------------------------------

LIMIT = PitchPlaneLimit("F1", "F4", "F5", lower=-0.5, upper=1.0)
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


def push(
    name: str, item: PitchPlaneLimit, dt: float, seconds: float = 0.8, count: int = 20
) -> tuple[np.ndarray, float]:
    """Constant commands against the margin rows from admissible starts: last states and the lowest margin."""
    model, rate = robot(name).model, 20.0
    inside = [q for q in states(name, 200, seed=16) if evaluate(name, item, q)[0].min() > 0.02][:count]
    assert len(inside) == count
    q = np.array(inside).T
    wanted = np.random.default_rng(17).normal(scale=0.4, size=(model.nv, count))
    mapped, none = compiled(name, item).map(count), np.zeros((1, count))
    lowest, touched = np.inf, 0
    for _ in range(round(seconds / dt)):
        margin, jacobian, _, _ = (np.array(o) for o in mapped(q, none))
        v = wanted.copy()
        for side, along in enumerate(jacobian.reshape(2, model.nv, count, order="F")):
            size = (along**2).sum(axis=0)
            short = np.maximum(-rate * margin[side] - (along * v).sum(axis=0), 0.0)
            touched += int((short > 0).sum())
            v = v + along * (short / np.where(size > 0, size, 1.0))
        q = q + dt * v
        lowest = min(lowest, float(np.array(mapped(q, none)[0]).min()))
    assert touched > 100
    return q, lowest


@pytest.mark.parametrize("case", LIMITS)
def test_closed_loop_stays_within_the_limit(case: str) -> None:
    """What is passed is the curvature of one tick: small, and in proportion to dt. Checked with Pinocchio's poses."""
    name, item = LIMITS[case]
    _, coarse = push(name, item, 0.004)
    last, fine = push(name, item, 0.002)
    assert coarse > -0.05
    assert min(coarse, -1e-3) * 0.7 < fine
    reached = [wrap(seen(name, item, q).psi - (item.lower + item.upper) / 2) for q in last.T]
    clear_now = [evaluate(name, item, q)[2][0] == 1.0 for q in last.T]
    assert sum(clear_now) > 5
    half = (item.upper - item.lower) / 2
    assert max(abs(a) for a, c in zip(reached, clear_now, strict=True) if c) < half - fine + 1e-9


# --- bad input -------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("error", "field_name", "make"),
    [
        (RangeError, "reference.pole", lambda: PlaneReference(pole=(0, 0, 0))),
        (RangeError, "reference.direction", lambda: PlaneReference(direction=(0, 0, 2))),
        (NotFiniteError, "reference.direction", lambda: PlaneReference(direction=(np.nan, 0, 2))),
        (ShapeError, "reference.pole", lambda: PlaneReference(pole=(0, 1))),
        (ShapeError, "reference", lambda: replace(PANDA, reference=(0, 0, 1))),
        (ShapeError, "elbow_offset", lambda: replace(PANDA, elbow_offset=(0, 1))),
        (RangeError, "line_width", lambda: replace(PANDA, line_width=0)),
        (RangeError, "elbow_width", lambda: replace(PANDA, elbow_width=1.5)),
        (RangeError, "reference_width", lambda: replace(PANDA, reference_width=4)),
        (NotFiniteError, "reference_width", lambda: replace(PANDA, reference_width=np.nan)),
        (BoundsError, "lower", lambda: replace(LIMIT, lower=1.0)),
        (RangeError, "upper", lambda: replace(LIMIT, upper=-0.5 + 2 * np.pi)),
        (NotFiniteError, "upper", lambda: replace(LIMIT, upper=np.inf)),
        (UnknownNameError, "elbow", lambda: replace(PANDA, elbow="panda_lnk4").validate(robot("panda"))),
        (UnknownNameError, "base", lambda: replace(PANDA, base="torso").validate(robot("panda"))),
        (UnknownNameError, "axis", lambda: replace(PANDA, axis="panda_joint44").validate(robot("panda"))),
        (UnknownNameError, "axis", lambda: replace(TALOS, axis="root_joint").validate(robot("talos"))),
        (RangeError, "wrist", lambda: replace(PANDA, wrist="panda_link2").validate(robot("panda"))),
        (RangeError, "axis", lambda: replace(PANDA, axis="panda_joint1").validate(robot("panda"))),
        (RangeError, "axis", lambda: replace(OFFSET, axis="joint3", base="F2").validate(robot("ssrms"))),
    ],
)
def test_bad_input(error: type[Exception], field_name: str, make: Callable[[], Any]) -> None:
    with pytest.raises(error) as caught:
        make()
    assert caught.value.field == field_name


def test_nearest_names_come_first() -> None:
    with pytest.raises(UnknownNameError) as caught:
        replace(PANDA, elbow="panda_lnk4").validate(robot("panda"))
    assert caught.value.choices[0] == "panda_link4"


def test_plain_numbers_are_welcome() -> None:
    item = replace(PANDA, elbow_offset=np.array([0, 0, 1], dtype=np.float32), reference_width=1)
    assert item.elbow_offset == (0.0, 0.0, 1.0)
    assert hash(item) == hash(replace(item))
    assert PlaneReference(pole=[0, 0, 5], direction=[3, 0, 1]) == PlaneReference()
