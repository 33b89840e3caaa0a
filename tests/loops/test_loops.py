"""Closed loops: every tick keeps them closed, MuJoCo's own residuals say so, and what cannot be closed is refused."""

from __future__ import annotations

import itertools
import pickle
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pinocchio as pin
import pytest

import wbc
from tests.loops.mechanisms import NAMED, four_bar, random_linkage, within
from tests.repeats import repeats
from wbc.errors import DuplicateNameError, NotFiniteError, RangeError, UnknownNameError, UnsupportedJointError
from wbc.robot import JointCurve, Loop, LoopError, Robot
from wbc.validation import Array

#: What a loop may be open by after a tick [m, rad]
OPEN = 1e-9
DT = 0.005


def qpos_of(robot: Robot, model: mujoco.MjModel, q: Array) -> Array:
    """MuJoCo's configuration: quaternions are w, x, y, z there."""
    out = np.zeros(model.nq)
    for name in robot.joint_names:
        j = robot.model.getJointId(name)
        numbers = q[robot.model.idx_qs[j] : robot.model.idx_qs[j] + robot.model.nqs[j]]
        at = model.jnt_qposadr[model.joint(name).id]
        out[at : at + len(numbers)] = numbers[[3, 0, 1, 2]] if len(numbers) == 4 else numbers
    return out


def opened(robot: Robot, text: str, configurations: list[Array]) -> float:
    """Largest residual of MuJoCo's equalities [m, rad]."""
    model, worst = mujoco.MjModel.from_xml_string(text), 0.0
    data = mujoco.MjData(model)
    for q in configurations:
        data.qpos[:] = qpos_of(robot, model, q)
        mujoco.mj_forward(model, data)
        equal = data.efc_type[: data.nefc] == int(mujoco.mjtConstraint.mjCNSTR_EQUALITY)
        worst = max(worst, float(np.abs(data.efc_pos[: data.nefc][equal]).max()))
    return worst


def walk(controller: wbc.Controller, ticks: int, seed: int = 0) -> list[Array]:
    """Configurations of ticks towards postures that are drawn anew every 60."""
    robot: Robot = controller.stack.robot
    rng, q, out = np.random.default_rng(seed), robot.neutral, []
    lower, upper = robot.limits.position_lower, robot.limits.position_upper
    has = robot.position_index >= 0
    for k in range(ticks):
        if k % 60 == 0:
            controller["posture"].target = pin.integrate(robot.model, q, 2.0 * rng.normal(size=robot.nv))
        step = controller.step(q)
        assert step.status == "solved", (k, step)
        assert (np.abs(step.v) <= robot.limits.velocity * (1.0 + 1e-9)).all()
        q = pin.integrate(robot.model, q, step.v * DT)
        at = q[robot.position_index[has]]
        assert (at >= lower[has] - 1e-9).all()
        assert (at <= upper[has] + 1e-9).all()
        out.append(q)
    return out


def limited(text: str, room: float = np.inf) -> Robot:
    """Of at most 3 rad/s, and within a room about neutral."""
    return within(wbc.robots.load(text).with_limits(velocity=3.0), room)


def followed(robot: Robot) -> wbc.Stack:
    """A posture within the joints' limits."""
    stack = wbc.Stack(robot, DT)
    return stack.add(wbc.tasks.Posture(), name="posture").add(wbc.tasks.JointLimits())


@pytest.mark.parametrize("room", [np.inf, 0.5])
@pytest.mark.parametrize("name", NAMED)
def test_a_mechanism_stays_closed(name: str, room: float) -> None:
    robot = limited(NAMED[name], room)
    ticks = walk(followed(robot).compile(), repeats(240))
    assert opened(robot, NAMED[name], ticks) < OPEN
    assert max(float(np.abs(robot.difference(ticks[0], q)).max()) for q in ticks) > 0.1, "nothing moved"


@pytest.mark.parametrize("seed", range(repeats(12)))
def test_random_linkages_stay_closed(seed: int) -> None:
    text = random_linkage(seed)
    robot = limited(text)
    assert opened(robot, text, walk(followed(robot).compile(), 120, seed)) < OPEN


@pytest.mark.compiled
def test_the_native_tick_keeps_them_too() -> None:
    robot = limited(NAMED["ankle"])
    assert opened(robot, NAMED["ankle"], walk(followed(robot).compile(backend="native"), 240)) < OPEN


@pytest.mark.parametrize("name", NAMED)
def test_drawn_and_integrated_configurations_are_closed(name: str) -> None:
    robot, rng = wbc.robots.load(NAMED[name]), np.random.default_rng(1)
    drawn = [robot.random(k) for k in range(3)]
    moved = [robot.integrate(robot.neutral, rng.uniform(-0.2, 0.2, robot.nv)) for _ in range(3)]
    assert opened(robot, NAMED[name], [robot.neutral, *drawn, *moved]) < OPEN
    assert not np.allclose(drawn[0], drawn[1])
    assert np.array_equal(robot.random(0), drawn[0])


def test_inverse_kinematics_ends_closed() -> None:
    robot = wbc.robots.load(four_bar())
    stack = wbc.Stack(robot, DT).add(wbc.tasks.EndEffector("coupler", kind="position"), name="hand")
    wanted = robot.random(3)
    solution = stack.solve(robot.neutral, {"hand": robot.pose(wanted, "coupler").translation})
    assert solution.solved
    assert opened(robot, four_bar(), [solution.q]) < OPEN


def test_an_open_start_closes_at_a_bounded_rate() -> None:
    robot = limited(four_bar())
    controller, q = followed(robot).compile(), robot.neutral + [0.0, 0.1, 0.0]
    gaps = []
    for _ in range(500):
        step = controller.step(q)
        assert (np.abs(step.v) <= 3.0 + 1e-9).all()
        q = pin.integrate(robot.model, q, step.v * DT)
        gaps.append(opened(robot, four_bar(), [q]))
    assert gaps[0] > 0.01
    assert gaps[-1] < OPEN
    assert all(later <= before + OPEN for before, later in itertools.pairwise(gaps))


def test_limits_hold_a_linkage_through_its_loop() -> None:
    """The crank stops where the rocker meets its limit."""
    robot = wbc.robots.load(four_bar()).with_limits(velocity=3.0, position_upper={"heel": 0.3})
    controller = followed(robot).compile()
    controller["posture"].target = [2.0, 0.0, 0.3]
    q = robot.neutral
    for _ in range(600):
        q = pin.integrate(robot.model, q, controller.step(q).v * DT)
    assert q[2] == pytest.approx(0.3, abs=1e-6)
    assert opened(robot, four_bar(), [q]) < OPEN


def test_rows_of_others_are_left_out() -> None:
    """Of a planar hinge two rows are left, of one that is there twice none."""
    robot = wbc.robots.load(four_bar())
    (loop,) = robot.loops.loops
    assert isinstance(loop, Loop)
    assert [unit for _, unit in robot.loops.rows] == ["m", "m"]
    twice = robot.with_loops(loop, Loop("again", loop.first, loop.second))
    assert [len(basis) for basis in twice.loops.bases] == [2, 0]
    assert len(wbc.robots.load(NAMED["gripper"]).loops.rows) == 5


def test_rows_that_mix_directions_have_names_of_their_own() -> None:
    """Of a planar hinge whose frame is turned out of the plane both rows are mostly along one axis."""
    tree = wbc.robots.load(four_bar()).with_loops()
    turned = pin.SE3(pin.rpy.rpyToMatrix(-0.4, -0.9, -1.2), np.array([0.45, 0.0, 0.1]))
    robot = tree.with_frame("turned", "coupler", turned).with_loops(Loop("pin", "turned", "pin:b"))
    basis = np.abs(robot.loops.bases[0])
    assert basis.argmax(axis=1).tolist() == [1, 1]
    assert len({label for label, _ in robot.loops.rows}) == 2
    assert followed(robot).compile().step(robot.neutral).status == "solved"


def test_loops_in_python_are_those_of_a_file() -> None:
    robot = wbc.robots.load(four_bar())
    tree = robot.with_loops()
    assert not tree.loops
    made = tree.with_frame("pin a", "coupler", pin.SE3(np.eye(3), np.array([0.45, 0.0, 0.1])))
    again = made.with_loops(Loop("pin", "pin a", "pin:b"))
    assert opened(again, four_bar(), [again.random(0)]) < OPEN
    assert pickle.loads(pickle.dumps(again)).fingerprint == again.fingerprint != made.fingerprint


def test_a_loop_to_the_world_stays_where_the_world_was() -> None:
    tree = wbc.robots.load(four_bar()).with_loops()
    robot = tree.with_frame("peg", "crank").with_loops(Loop("pin", "peg", "world", "hinge"))
    seen = robot.seen_from(pin.SE3(pin.rpy.rpyToMatrix(0.1, 0.2, 0.3), np.array([1.0, 2.0, 3.0])))
    assert seen.loop_gaps(seen.neutral) == pytest.approx(robot.loop_gaps(robot.neutral))
    assert seen.loop_gaps([0.1, 0.2, 0.3]) == pytest.approx(robot.loop_gaps([0.1, 0.2, 0.3]))


def test_a_joint_follows_a_polynomial() -> None:
    robot = wbc.robots.load(NAMED["gripper"])
    q = robot.closed(robot.integrate(robot.neutral, [0.1] * robot.nv))
    left, right = (q[robot.model.idx_qs[robot.model.getJointId(f"{side}_motor")]] for side in ("left", "right"))
    assert right == pytest.approx(left + 0.1 * left**2, abs=OPEN)
    still = robot.with_loops(JointCurve("stop", "left_motor", None, (0.2,)))
    assert still.neutral[still.model.idx_qs[still.model.getJointId("left_motor")]] == pytest.approx(0.2)


def test_recordings_batches_and_clones_keep_them(tmp_path: Path) -> None:
    robot = limited(NAMED["ankle"])
    controller = followed(robot).compile()
    with controller.record(tmp_path / "run.npz"):
        ticks = walk(controller, 20)
    assert wbc.replay(tmp_path / "run.npz").identical
    batch = controller.batch(3)
    v = batch.step(np.array([ticks[-1]] * 3)).v
    assert opened(robot, NAMED["ankle"], [pin.integrate(robot.model, ticks[-1], one * DT) for one in v]) < OPEN


@pytest.mark.parametrize(
    ("change", "error", "words"),
    [
        (lambda r: r.with_loops(Loop("far", "rocker", "crank"), Loop("near", "world", "crank")), LoopError, "open by"),
        (lambda r: r.with_loops(Loop("pin", "crnk", "rocker")), UnknownNameError, "crank"),
        (
            lambda r: r.with_loops(Loop("pin", "crank", "coupler"), Loop("pin", "crank", "rocker")),
            DuplicateNameError,
            "pin",
        ),
        (lambda r: r.with_loops(JointCurve("turn", "moter", None, (0.0,))), UnknownNameError, "motor"),
        (lambda r: JointCurve("turn", "motor", "motor", (0.0, 0.5)), RangeError, "follow itself"),
        (lambda r: Loop("pin", "crank", "rocker", "wld"), UnknownNameError, "weld"),  # type: ignore[arg-type]
        (wbc.support.braking, UnsupportedJointError, "with_loops"),
        (lambda r: r.closed([np.nan] * 3), NotFiniteError, "q"),
    ],
)
def test_refusals_name_what_is_wrong(change: Any, error: type[Exception], words: str) -> None:
    robot = wbc.robots.load(four_bar())
    with pytest.raises(error, match=words):
        change(robot)


def test_loops_that_cannot_be_closed_are_refused_at_load() -> None:
    far = '<body name="far" pos="5 0 0"/></worldbody>'
    loop = '<weld name="reach" body1="far" body2="coupler" relpose="0 0 0 1 0 0 0"/></equality>'
    text = four_bar().replace("</worldbody>", far).replace("</equality>", loop)
    with pytest.raises(LoopError, match=r"open by 4.*reach"):
        wbc.robots.load(text)


@pytest.mark.parametrize("solver", ["python", "osqp", "qpoases"])
def test_other_solvers_keep_them_too(solver: str) -> None:
    robot = limited(NAMED["ankle"])
    assert opened(robot, NAMED["ankle"], walk(followed(robot).compile(solver=solver), 60)) < OPEN


def test_assembly_modes_of_a_four_bar_are_those_of_its_circles() -> None:
    """With the crank given the pin is where two circles meet: two modes, or none where they do not."""
    robot = wbc.robots.load(four_bar())
    modes = robot.assemblies({"motor": 0.3}, count=30)
    assert len(modes) == 2
    assert opened(robot, four_bar(), list(modes)) < OPEN
    knee = np.array([robot.pose(q, "coupler").translation for q in modes])
    np.testing.assert_allclose(knee[0], knee[1], atol=OPEN)
    pins = np.array([robot.pose(q, "pin:a").translation for q in modes])
    foot = np.array([0.5, 0.0, 0.0])
    along = foot - knee[0]
    gap, rod, rocker = (float(np.linalg.norm(v)) for v in (along, [0.45, 0.0, 0.1], [0.05, 0.0, -0.3]))
    far = (gap**2 + rod**2 - rocker**2) / (2.0 * gap)
    aside = np.cross(along / gap, [0.0, 1.0, 0.0]) * np.sqrt(rod**2 - far**2)
    wanted = knee[0] + along / gap * far + np.outer([1.0, -1.0], aside)
    assert min(np.abs(pins - wanted).max(), np.abs(pins[::-1] - wanted).max()) < 1e-9
    assert robot.assemblies({"heel": 2.55}, count=10) == ()
    with pytest.raises(UnknownNameError, match="motor"):
        robot.assemblies({"moter": 0.3})


def test_derivatives_go_along_the_loop() -> None:
    """They are those of the tick itself, but for what rows bend by within it."""
    robot = limited(NAMED["ankle"])
    controller = followed(robot).compile()
    q = walk(controller, 30)[-1]
    target = robot.integrate(q, np.full(robot.nv, 0.02))

    def answer(change: Array) -> wbc.Step:
        controller.reset(q)
        controller["posture"].target = pin.integrate(robot.model, target, change)
        return controller.step(q)

    slope = answer(np.zeros(robot.nv)).derivative("posture", "target")
    h = 1e-5
    found = [(answer(h * e).v - answer(-h * e).v) / (2.0 * h) for e in np.eye(robot.nv)]
    np.testing.assert_allclose(slope, np.transpose(found), atol=2e-2 * np.abs(slope).max())
