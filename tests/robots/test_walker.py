"""The walker: its model against plain products of the link matrices, its data, its URDF, its shapes."""

from __future__ import annotations

import tomllib
from dataclasses import fields, replace
from itertools import pairwise
from math import cos, pi, radians, sin
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

import wbc.robots
from tests.refusals import assert_refused
from wbc.errors import NotFiniteError, RangeError, RobotFileError, ShapeError, UnknownNameError
from wbc.robots import TwoEndedData, Walker, WalkerData, walker
from wbc.robots.walker_data import FILE, INCH, WALKER_DIGEST
from wbc.shapes import Capsule, Convex, Cylinder, Sphere

MACHINES = {
    "three": walker(),
    "four, wider": walker(4, shoulder_radius=0.5),
    "two arms": walker(2),
    "two-ended": walker(two_ended=True),
}
#: Table II (alpha [deg], a, s [in], offset [deg])
TABLE_II = [(90, 0, 26, 180), (0, 17, 6, 90), (90, 0, 0, 90), (90, 0, 17, 180), (90, 0, 0, 180), (0, 0, 6, 0)]


def frames(machine: Walker, q: np.ndarray) -> dict[str, np.ndarray]:
    """Homogeneous matrices of all frames."""
    model = machine.robot.model
    data = model.createData()
    pin.framesForwardKinematics(model, data, q)
    return {str(f.name): data.oMf[k].homogeneous for k, f in enumerate(model.frames)}


def link_matrix(alpha: float, a: float, s: float, theta: float) -> np.ndarray:
    """(3-5) of the source."""
    ct, st, ca, sa = cos(theta), sin(theta), cos(alpha), sin(alpha)
    return np.array([[ct, -ca * st, sa * st, a * ct], [st, ca * ct, -sa * ct, a * st], [0, sa, ca, s], [0, 0, 0, 1]])


def random_configuration(machine: Walker, rng: np.random.Generator) -> np.ndarray:
    q = np.r_[rng.normal(size=7), rng.uniform(-2.5, 2.5, machine.robot.nq - 7)]
    q[3:7] /= np.linalg.norm(q[3:7])
    return q


def test_arms_are_the_products_of_the_link_matrices() -> None:
    machine, rng = MACHINES["four, wider"], np.random.default_rng(1)
    for _ in range(5):
        q = random_configuration(machine, rng)
        found = frames(machine, q)
        for number, arm in enumerate(machine.arms):
            turn = np.eye(4)
            turn[:3, :3] = pin.utils.rotate("z", number * pi / 2)
            turn[:3, 3] = 0.5 * turn[:3, 0]
            expected = found["body"] @ turn
            np.testing.assert_allclose(found[arm.base_frame], expected, atol=1e-13)
            np.testing.assert_allclose(arm.base.homogeneous, turn, atol=1e-15)
            for (alpha, a, s, offset), angle in zip(TABLE_II, q[arm.q], strict=True):
                expected = expected @ link_matrix(radians(alpha), a * INCH, s * INCH, angle + radians(offset))
            np.testing.assert_allclose(found[arm.hand], expected, atol=1e-13)


def test_indices_and_limits_are_those_of_the_joints() -> None:
    machine = MACHINES["three"]
    robot, data = machine.robot, machine.data
    assert isinstance(data, WalkerData)
    assert (robot.nq, robot.nv, robot.base) == (25, 24, "floating")
    for number, arm in enumerate(machine.arms):
        assert arm.joints == tuple(f"arm{number + 1}_joint{k}" for k in range(1, 7))
        assert [robot.dofs(joint).start for joint in arm.joints] == list(range(arm.v.start, arm.v.stop))
        assert arm.q == slice(arm.v.start + 1, arm.v.stop + 1)
        degrees = np.degrees(robot.limits.position_upper[arm.v])
        np.testing.assert_allclose(degrees, [160, 165, 135, 135, 105, 270], rtol=1e-14)
        np.testing.assert_array_equal(robot.limits.position_lower[arm.v], -robot.limits.position_upper[arm.v])
        np.testing.assert_allclose(np.degrees(robot.limits.velocity[arm.v]), [82, 74, 122, 228, 241, 228], rtol=1e-14)
        np.testing.assert_allclose(robot.limits.acceleration[arm.v], robot.limits.velocity[arm.v] * 4, rtol=1e-14)
        np.testing.assert_array_equal(robot.neutral[arm.q], data.initial_posture)
    assert not np.isfinite(robot.limits.velocity[:6]).any()
    limited = walker(artificial_limits=True).robot.limits
    assert np.degrees(limited.position_upper[8]) == pytest.approx(-1.0)
    assert np.degrees(limited.position_lower[8]) == pytest.approx(-135.0)


@pytest.mark.parametrize("name", MACHINES)
def test_urdf_gives_the_same_machine(name: str, tmp_path: Path) -> None:
    machine = MACHINES[name]
    loaded = wbc.robots.load(machine.urdf(tmp_path / "machine.urdf"), base="floating", shapes="exact")
    robot, rng = machine.robot, np.random.default_rng(2)
    assert loaded.joint_names == robot.joint_names
    for limit in ("position_lower", "position_upper", "velocity"):
        np.testing.assert_array_equal(getattr(loaded.limits, limit), getattr(robot.limits, limit))
    data = loaded.model.createData()
    for _ in range(5):
        q = random_configuration(machine, rng)
        own = frames(machine, q)
        pin.framesForwardKinematics(loaded.model, data, q)
        for frame in (f"{arm.name}_{end}" for arm in machine.arms for end in ("base", "hand")):
            placed = data.oMf[loaded.model.getFrameId(frame)].homogeneous
            np.testing.assert_allclose(placed, own[frame], atol=1e-12)
    for link, group in robot.shapes.items():
        # A capsule is a cylinder and two balls in URDF
        cores = [shape for shape in loaded.shapes[link] if isinstance(shape.shape, Cylinder)]
        balls = [shape for shape in loaded.shapes[link] if isinstance(shape.shape, Sphere)]
        ends = [end for shape in group for end in shape.ends()[: 2 if isinstance(shape.shape, Capsule) else 1]]
        np.testing.assert_allclose([ball.placement.translation for ball in balls], ends, atol=1e-12)
        capsules = [shape for shape in group if isinstance(shape.shape, Capsule)]
        for shape, core in zip(capsules, cores, strict=True):
            np.testing.assert_allclose(core.placement.homogeneous, shape.placement.homogeneous, atol=1e-12)
            assert isinstance(core.shape, Cylinder)
            assert isinstance(shape.shape, Capsule)
            assert (core.shape.radius, core.shape.length) == (shape.shape.radius, shape.shape.length)


def test_two_ended_arm_has_its_offsets_and_one_chain() -> None:
    machine = MACHINES["two-ended"]
    robot, data = machine.robot, machine.data
    assert isinstance(data, TwoEndedData)
    assert (robot.nq, len(machine.arms)) == (14, 2)
    joints = [joint for arm in machine.arms for joint in arm.joints]
    assert joints == [f"arm{1 if k < 4 else 2}_joint{k}" for k in (3, 2, 1, 4, 5, 6, 7)]
    np.testing.assert_allclose(np.degrees(robot.limits.position_upper[6:]), 270.0)
    np.testing.assert_allclose(np.degrees(robot.limits.velocity[6:]), 4.0)
    # The chain from tip to tip, by the rows of its own table
    rng = np.random.default_rng(3)
    quarter = pi / 2
    rows = [
        (quarter, 0, 1.3589, quarter),
        (quarter, 0, 0.7026, quarter),
        (0, 7.11, 0.5692, 0),
        (0, 7.11, 0.475, 0),
        (quarter, 0, 0.5692, quarter),
        (-quarter, 0, 0.7026, -quarter),
        (0, 0, 1.3589, 0),
    ]
    flip = np.diag([1.0, -1.0, -1.0, 1.0])
    for _ in range(5):
        q = random_configuration(machine, rng)
        by_number = dict(zip((3, 2, 1, 4, 5, 6, 7), q[7:], strict=True))
        whole = np.eye(4)
        for number, (alpha, a, s, offset) in enumerate(rows, start=1):
            whole = whole @ link_matrix(alpha, a, s, by_number[number] + offset)
        found = frames(machine, q)
        # The near hand is the chain's base turned about x, so that it points away from the chain
        np.testing.assert_allclose(np.linalg.inv(found["arm1_hand"] @ flip) @ found["arm2_hand"], whole, atol=1e-12)
    at_rest = frames(machine, robot.neutral)
    np.testing.assert_allclose(at_rest["arm1_hand"][:3, 2], at_rest["arm2_hand"][:3, 2], atol=1e-12)


@pytest.mark.parametrize("name", MACHINES)
def test_shapes_are_apart_where_the_machine_starts(name: str) -> None:
    robot = MACHINES[name].robot
    found = wbc.robots.find_self_pairs(robot, samples=0)
    assert not [pair for pair in found.pairs if pair.reason == "neutral" and pair.links in (robot.self_pairs or ())]
    assert robot.self_pairs


def test_capsules_lie_between_the_named_points() -> None:
    """The ends of the capsules at the zero posture, where the arm stands straight along z."""
    machine = MACHINES["three"]
    q = pin.neutral(machine.robot.model)
    found, arm = frames(machine, q), machine.arms[0]
    to_base = np.linalg.inv(found[arm.base_frame])
    points = [(0, 0, 0), (0, 0, 26), (0, 6, 26), (0, 6, 43), (0, 6, 43), (0, 6, 60), (0, 6, 60), (0, 6, 66)]
    for link, a, b, radius in zip(arm.links, points[::2], points[1::2], (4, 3, 2.5, 2), strict=True):
        (placed,) = machine.robot.shapes[link]
        ends = [(to_base @ found[link] @ np.r_[end, 1.0])[:3] / INCH for end in placed.ends()]
        np.testing.assert_allclose(ends, [a, b], atol=1e-12)
        assert placed.shape.radius == pytest.approx(radius * INCH)  # type: ignore[union-attr]


def test_neighbours_and_necks_are_no_pairs() -> None:
    pairs = {frozenset(pair) for pair in MACHINES["three"].robot.self_pairs or ()}
    assert len(pairs) == 60
    for i in (1, 2, 3):
        chain = ["body", *(f"arm{i}_link{k}" for k in (1, 2, 4, 6))]
        assert not {frozenset(pair) for pair in pairwise(chain)} & pairs
        assert frozenset(("body", f"arm{i}_link6")) in pairs
        assert frozenset(("body", f"arm{i}_link2")) not in pairs
    assert frozenset(("arm1_link1", "arm2_link1")) not in pairs
    assert frozenset(("arm1_link1", "arm2_link6")) in pairs


def test_an_upper_arm_that_reaches_the_body_is_a_pair() -> None:
    data = WalkerData.read(upper_arm_length=0.6)
    assert ("body", "arm1_link2") in (walker(data=data).robot.self_pairs or ())


@pytest.mark.parametrize(("radius", "count"), [(None, 4), (0.45, 6)])
def test_no_hand_fits_through_the_body(radius: float | None, count: int) -> None:
    machine = walker(shoulder_radius=radius)
    shapes, data = machine.robot.shapes["body"], machine.data
    assert isinstance(data, WalkerData)
    assert len(shapes) == count
    corners = np.array([arm.base.translation for arm in machine.arms])
    weights = np.random.default_rng(4).dirichlet(np.ones(3), 3000)
    distances = []
    for shape in shapes:
        a, b = shape.ends()
        span = b - a
        along = np.clip((weights @ corners - a) @ span / max(float(span @ span), 1e-12), 0.0, 1.0)
        distances.append(np.linalg.norm(weights @ corners - a - along[:, None] * span, axis=1))
    assert np.min(distances, axis=0).max() < data.body_half_thickness + data.hand_radius


def test_body_shapes() -> None:
    prism = walker(body_shape="prism").robot.shapes["body"][0].shape
    assert isinstance(prism, Convex)
    assert np.ptp(prism.points[:, 2]) == pytest.approx(6 * INCH)
    np.testing.assert_allclose(np.linalg.norm(prism.points[:, :2], axis=1), 12 * INCH)
    bare = walker(body_shape="none").robot
    assert "body" not in bare.shapes
    assert not [pair for pair in bare.self_pairs or () if "body" in pair]


def test_the_table_of_names_knows_the_machines() -> None:
    for name, machine in (("walker", MACHINES["three"]), ("two_ended_arm", MACHINES["two-ended"])):
        loaded = wbc.robots.load(name)
        assert loaded.fingerprint == machine.robot.fingerprint
        assert loaded.notes["data"] == machine.data.digest
        faster = wbc.robots.load(name, velocity=9.0, base="fixed")
        assert faster.base == "fixed"
        assert set(faster.limits.velocity) == {9.0}


def test_data_is_the_file_in_si_and_every_change_has_its_digest(tmp_path: Path) -> None:
    data, raw = WalkerData.read(), tomllib.loads(FILE.read_text())
    assert set(raw) == {"published", "assumed", "two_ended", "two_ended_assumed"}
    assert data.neck_length == 26 * INCH
    assert data.joint_rates[0] == pytest.approx(radians(82), rel=1e-15)
    assert data.clearance == INCH
    assert len(raw["published"]) + len(raw["assumed"]) == len(fields(data))
    digests = {data.digest, WalkerData.read(clearance=0.03).digest, replace(data, acceleration_time=0.2).digest}
    assert len(digests) == 3
    assert WalkerData.read().digest == data.digest == WalkerData.read(clearance=INCH).digest
    assert walker(shoulder_radius=0.4).data.digest != data.digest
    other = tmp_path / "other.toml"
    other.write_text(FILE.read_text().replace("clearance_in = 1.0", "clearance_in = 3.0"))
    assert WalkerData.read(other).clearance == 3 * INCH


def test_data_says_where_its_numbers_come_from() -> None:
    data = WalkerData.read(clearance=0.03)
    assert WalkerData.read().digest == WALKER_DIGEST
    origins = data.origins()
    assert set(origins.values()) == {"published", "assumed", "changed"}
    assert (origins["neck_length"], origins["joint_rates"], origins["clearance"]) == ("published", "assumed", "changed")
    assert data.summary() == f"WalkerData {data.digest}; changed: clearance = 0.03"
    assert WalkerData.read().summary() == f"WalkerData {WALKER_DIGEST}"
    assert set(TwoEndedData.read().origins().values()) == {"published", "assumed"}


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("clearance_in = 1.0", "clearance = 1.0", "must end with its unit"),
        ("clearance_in = 1.0", "clarence_in = 1.0", "no such field"),
        ("clearance_in = 1.0", "", "lacks clearance"),
        ("[assumed]", "[guessed]", "[assumed] must be there"),
        ("clearance_in = 1.0", "clearance_in = ", "cannot be read"),
    ],
)
def test_bad_data_files_are_refused(old: str, new: str, said: str, tmp_path: Path) -> None:
    bad = tmp_path / "bad.toml"
    bad.write_text(FILE.read_text().replace(old, new))
    with pytest.raises(RobotFileError) as caught:
        WalkerData.read(bad)
    assert said in str(caught.value)


def test_bad_arguments_are_refused() -> None:
    assert_refused(lambda: walker(1), RangeError, "arms")
    assert_refused(lambda: walker(shoulder_radius=-0.1), RangeError, "shoulder_radius")
    assert_refused(lambda: WalkerData.read(clearence=0.1), UnknownNameError, "clearance")
    assert_refused(lambda: WalkerData.read(hand_length=np.nan), NotFiniteError, "hand_length")
    assert_refused(lambda: WalkerData.read(joint_rates=[1.0, 2.0]), ShapeError, "joint_rates")
    assert_refused(lambda: WalkerData.read(joint_rates=[1.0, 2.0, 0.0, 1.0, 1.0, 1.0]), RangeError, "joint_rates")
    assert_refused(lambda: walker(two_ended=True, data=WalkerData.read()), ShapeError, "TwoEndedData")
    assert_refused(lambda: walker(two_ended=True, shoulder_radius=0.3), RangeError, "two_ended")
    assert_refused(lambda: walker(body_shape="prisma"), UnknownNameError, "prism")
    assert_refused(lambda: MACHINES["three"].arm("arm4"), UnknownNameError, "arm1")
    assert_refused(lambda: MACHINES["three"].urdf("/nowhere/at/all.urdf"), RobotFileError, "written")
