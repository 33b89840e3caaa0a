"""Modes, advice and driving of arms that nobody published: random chains, files, trees; or what they lack, by name."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

from tests.repeats import ALL, MORE
from wbc.coordinates import (
    Adviser,
    Arm,
    BodyRows,
    Coordinate,
    CoordinatePair,
    JointRows,
    MissingPartError,
    Mode,
    mode_pairs,
    mode_row,
    modes_of,
    parts,
    regular_start,
)
from wbc.coordinates.expressions import rate_function
from wbc.errors import ShapeError, UnknownNameError
from wbc.robot import Robot
from wbc.robot.sampling import configuration, draw
from wbc.robot.sources.files import example_data_folder
from wbc.robots import DHRow, from_dh, load
from wbc.teleop import Order, Teleoperation


def random_arm(seed: int, scale: float = 1.0) -> Robot:
    """4 to 9 joints, some of them sliding, half of the arms at right angles, limits here and there."""
    rng = np.random.default_rng(seed)
    right, rows = rng.random() < 0.5, []
    for _ in range(int(rng.integers(4, 10))):
        turn = rng.choice([0.0, np.pi / 2, -np.pi / 2]) if right else rng.uniform(-2.0, 2.0)
        sliding = rng.random() < 0.15
        a, d = (scale * x * (rng.random() < 0.6) for x in rng.uniform(0.1, 0.5, 2))
        limit = rng.uniform(0.5, 3.0) * (scale if sliding else 1.0)
        low = -limit if rng.random() < 0.7 else -np.inf
        kind = "prismatic" if sliding else "revolute"
        rows.append(
            DHRow(a=a, alpha=float(turn), d=d, theta=float(rng.uniform(-2, 2)), joint=kind, lower=low, upper=-low)
        )
    return from_dh(rows)


def jacobian(robot: Robot, rows: tuple[Coordinate, ...], q: np.ndarray) -> np.ndarray:
    """Rows of bodies and joints by Pinocchio alone."""
    data, out = robot.model.createData(), [np.zeros((0, robot.nv))]
    for one in rows:
        if isinstance(one, JointRows):
            out.append(np.eye(robot.nv)[robot.dofs(one.joint)])
            continue
        assert isinstance(one, BodyRows)
        index = robot.model.getFrameId(one.frame)
        J = pin.computeFrameJacobian(robot.model, data, q, index, pin.LOCAL_WORLD_ALIGNED).reshape(6, -1)
        out.append(J[[*one.translation, *(3 + k for k in one.rotation)]])
    return np.vstack(out)


def plain(pair: CoordinatePair) -> bool:
    return all(isinstance(one, BodyRows | JointRows) for one in pair.rows)


@pytest.mark.parametrize("seed", range(6))
def test_random_arms_have_modes_whose_pairs_determine_their_joints(seed: int) -> None:
    arm = random_arm(seed)
    robot, row = parts(arm).robot, mode_row(arm)
    every = [pair for found in row.values() if not isinstance(found, str) for pair in found]
    assert not isinstance(row[Mode.M1], str)
    assert not isinstance(row[Mode.M5], str)
    assert len(row[Mode.M5]) == robot.nv
    assert row[Mode.M7] == "carrier"
    rng, looked = np.random.default_rng(seed), 0
    states = [configuration(robot, step) for step in draw(robot, 12, rng)]
    for pair in every:
        n, p = pair.counts(robot)
        assert n + p >= robot.nv
        if plain(pair):
            sigma = [np.linalg.svd(jacobian(robot, pair.rows, q), compute_uv=False) for q in states]
            assert max(s[-1] / s[0] for s in sigma) > 1e-6, pair.name
            looked += 1
    assert looked > robot.nv
    spare = parts(arm).arms[0].redundancy
    (first, *_) = row[Mode.M1]
    assert len(first.constraint) == spare


@pytest.mark.parametrize("seed", [0, 3, 5, 8][:: 1 if MORE >= ALL else 2])
def test_an_arm_of_another_size_has_the_same_modes_and_advice(seed: int) -> None:
    """In millimetres, and as small as a watch: the same pairs, and ranks that are lost at the same places."""
    arms = [random_arm(seed, scale) for scale in (1.0, 1e3, 1e-2)]
    names = [[str([str(p) for p in pairs]) for pairs in mode_row(arm).values()] for arm in arms]
    assert names[0] == names[1] == names[2]
    advice = []
    for arm, scale in zip(arms, (1.0, 1e3, 1e-2), strict=True):
        robot, pairs = parts(arm).robot, mode_pairs(arm, "M1")
        sliding = np.array([scale if unit == "m" else 1.0 for unit in robot.dof_units])
        q = np.where(np.arange(robot.nv) % 3 == 1, 0.0, np.linspace(-0.3, 0.4, robot.nv)) * sliding
        advice.append(Adviser(robot, pairs, exact=False, backend="vm").advise(q))
    for same in zip(*advice, strict=True):
        assert len({one.condition for one in same}) == 1
        assert [one.sigma for one in same] == pytest.approx([same[0].sigma] * 3, rel=1e-6, abs=1e-12)


@pytest.mark.parametrize("seed", [1, 2, 4, 6][:: 1 if MORE >= ALL else 2])
def test_a_random_arm_is_driven_and_tells_what_it_loses(seed: int) -> None:
    """From a regular start every pair of M1 and M2 moves as it is told, or says why it does not."""
    arm = random_arm(seed)
    session = Teleoperation(arm, seconds=0.0, acceleration=20.0, fastest=(10.0, 10.0), backend="vm")
    start = session.start()
    adviser = Adviser(session.robot, session.control.pairs.values(), exact=False, backend="vm")
    assert {one.condition for one in adviser.advise(start)} == {"regular"}
    for name in session.names:
        session.control.switch(name, 0.0)
        session.reset(start)
        session.step(start, Order(pair=name))
        rows = len(session.units)
        rates = 1e-3 * session.robot.characteristic_length * np.linspace(1.0, 0.5, rows)
        q = start
        for _ in range(10):
            seen = session.step(q, Order(tuple(rates)))
            assert seen.active == name
            assert np.isfinite([*seen.step.v, seen.sigma, seen.kept, seen.lost]).all()
            assert seen.lost < 1e-3 or seen.why
            # What is told to be met is what Pinocchio says
            task = session.control.pair.task
            if all(isinstance(one, BodyRows) for one in task):
                met = jacobian(session.robot, task, q) @ seen.step.v
                np.testing.assert_allclose(seen.met, met, atol=1e-9)
            q = pin.integrate(session.robot.model, q, session.control.dt * seen.step.v)
        assert seen.lost < 1e-2, (name, seen.why)


def test_arms_from_files_brake_their_fingers(tmp_path: Path) -> None:
    """A Panda with two fingers, from its URDF: the arm is the seven joints before them."""
    file = str(example_data_folder() / "panda_description" / "urdf" / "panda.urdf")
    found = parts(file)
    (arm,) = found.arms
    assert arm.joints == tuple(f"panda_joint{k}" for k in range(1, 8))
    assert found.others == ("panda_finger_joint1", "panda_finger_joint2")
    for pair in mode_pairs(file, "M1"):
        assert {str(one) for one in pair.constraint} >= set(found.others)
    assert [pair.name for pair in mode_pairs(file, "M8")] == ["elbow | pose"]


FIVE = """<mujoco model="five"><compiler angle="radian"/><worldbody>
<body name="b1" pos="0 0 0.2"><inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/>{first}
<body name="b2" pos="0 0 0.1"><inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/><joint name="pitch" axis="0 1 0"/>
<body name="b3" pos="0.3 0 0"><inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/><joint name="elbow" axis="0 1 0"/>
<body name="b4" pos="0.3 0 0"><inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/><joint name="roll" axis="1 0 0"/>
<body name="b5" pos="0.1 0 0"><inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/>
<joint name="slide" type="slide" axis="1 0 0" range="0 0.2"/></body>
</body></body></body></body></worldbody></mujoco>"""


def test_an_mjcf_arm_and_one_with_a_ball_joint(tmp_path: Path) -> None:
    file, bad = tmp_path / "five.xml", tmp_path / "ball.xml"
    file.write_text(FIVE.format(first='<joint name="yaw" axis="0 0 1"/>'))
    (arm,) = parts(str(file)).arms
    assert arm.joints == ("yaw", "pitch", "elbow", "roll", "slide")
    assert (len(arm.tip.translation), len(arm.tip.rotation), arm.redundancy) == (3, 0, 2)
    assert modes_of(str(file), ["M1", "M2", "M6"]) == (Mode.M1, Mode.M2)
    bad.write_text(FIVE.format(first='<joint name="globe" type="ball"/>'))
    with pytest.raises(MissingPartError, match="'globe' has 3"):
        mode_row(str(bad))


@pytest.mark.parametrize(
    ("name", "mode", "part"),
    [
        ("ur5", "M2", "joint beyond those that its tip takes"),
        ("panda", "M6", "second arm"),
        ("baxter", "M7", "carrier"),
        ("a1", "M1", "base that stands somewhere; it floats"),
    ],
)
def test_what_is_missing_is_said_by_name(name: str, mode: str, part: str) -> None:
    with pytest.raises(MissingPartError, match=f"the robot has no {part}") as caught:
        mode_pairs(name, mode)
    assert caught.value.part == part


def test_parts_of_known_arms() -> None:
    """Six joints need no constraint; two arms of a torso; a driving base and a head have brakes."""
    (pair,) = mode_pairs("ur5", "M1")
    assert (pair.name, pair.constraint) == ("pose | nothing", ())
    both = parts("baxter")
    assert [arm.prefix for arm in both.arms] == ["left_", "right_"]
    assert both.others == ("head_pan",)
    assert [p.name for p in mode_pairs("baxter", "M6")] == ["left_pose | the rest", "right_pose | the rest"]
    tiago = parts("tiago")
    assert tiago.others == ("root_joint", "head_1_joint", "head_2_joint")
    assert (len(tiago.arms[0].joints), tiago.arms[0].redundancy) == (8, 2)
    (xarm,) = parts("xarm7").arms
    assert isinstance(xarm, Arm)
    assert xarm.alpha is None
    assert str(xarm.plane) == "psi"
    # A chain that is published by name is found again in its tree: three parallel pitch axes, beta and gamma
    (again,) = parts(parts("ssrms").robot).arms
    assert again.alpha is not None
    assert [str(one) for one in again.in_plane] == ["beta", "gamma"]
    assert [str(some[0]) for some in again.sets][:3] == ["alpha", "beta", "gamma"]


def test_found_alpha_beta_and_gamma_are_the_published_ones() -> None:
    published, found = parts("ssrms"), parts(parts("ssrms").robot)
    old, new = published.arms[0], found.arms[0]
    assert old.alpha is not None
    assert new.alpha is not None
    for q in np.random.default_rng(3).uniform(-2.0, 2.0, (5, 7)):
        for one, other in zip((old.alpha, *old.in_plane), (new.alpha, *new.in_plane), strict=True):
            row, again = rate_function(published.robot, (one,))(q), rate_function(found.robot, (other,))(q)
            np.testing.assert_allclose(row.full(), again.full(), atol=1e-12)


def test_a_start_is_away_from_singular_configurations() -> None:
    """The neutral configuration of the Space Station arm is singular; that of the UR5 will do."""
    robot, pairs = parts("ssrms").robot, mode_pairs("ssrms", "M1")
    q = regular_start(robot, pairs)
    conditions = {one.condition for one in Adviser(robot, pairs, exact=False, backend="vm").advise(q)}
    assert conditions == {"regular"}
    assert "task" in {one.condition for one in Adviser(robot, pairs, exact=False, backend="vm").advise(robot.neutral)}
    assert (q >= robot.limits.position_lower).all()
    assert (q <= robot.limits.position_upper).all()
    ur5 = load("ur5")
    np.testing.assert_array_equal(regular_start(parts(ur5).robot, mode_pairs(ur5, "M1")), ur5.neutral)
    with pytest.raises(ShapeError):
        regular_start(robot, [])


def test_bad_names() -> None:
    with pytest.raises(UnknownNameError, match="did you mean 'panda'"):
        parts("pnda")
    with pytest.raises(ShapeError, match="expected a name, a file, or a Robot"):
        parts(7)  # type: ignore[arg-type]
    with pytest.raises(UnknownNameError):
        mode_pairs("panda", "M9")
