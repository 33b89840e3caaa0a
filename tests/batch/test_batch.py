"""Ticks of a batch are those of single controllers, bit for bit; bad values of one robot are refused by its number."""

from __future__ import annotations

import _thread
import os
import signal
import time
from collections.abc import Callable
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

from tests.backends import COMPILED
from tests.controller.stacks import aim, controller, inside, near_limits, robot
from tests.levels import arms
from tests.repeats import covering
from tests.torque import problems
from wbc import Controller, Policy, Stack, Status
from wbc.batch import Batch
from wbc.batch.engine import Compiled
from wbc.controller import core_of
from wbc.errors import (
    CommandError,
    NotFiniteError,
    RangeError,
    RotationError,
    ShapeError,
    SolverError,
    UnknownNameError,
)
from wbc.shapes import Box
from wbc.tasks import EndEffector, JointLimits, Obstacle, Posture, WorkspaceBox

Made = Callable[[str], Controller]


def soft(backend: str) -> Controller:
    """Soft rows that are kept from tick to tick, and a scaled task."""
    stack = Stack(robot("panda"), 0.005)
    stack.add(EndEffector("panda_hand_tcp"), name="hand", scaled=True)
    stack.add(Posture(), name="posture", weight=1e-3)
    stack.add(JointLimits(), name="limits")
    box = WorkspaceBox("panda_hand_tcp", lower=(-0.3, -0.3, 0.2), upper=(0.3, 0.3, 0.6))
    stack.add(box, name="box", soft=1e3)
    return stack.compile(backend=backend)


def bare(backend: str) -> Controller:
    """Without general rows."""
    return controller("arm", "panda", 1e-3, False, backend=backend)


MADE: dict[str, Made] = {
    "bare": bare,
    "arm": lambda backend: controller("arm", "panda", backend=backend),
    "conflicts": lambda backend: controller("conflicts", backend=backend),
    "humanoid": lambda backend: controller("humanoid", backend=backend),
    "soft": soft,
    "levels": lambda backend: arms.levels().compile(backend=backend),
    "torque": lambda backend: problems.stack("panda").compile(command="torque", backend=backend),
}


def values(of: Controller) -> dict[str, dict[str, Any]]:
    """What the inputs of a controller are, and weights of its tasks."""
    found: dict[str, dict[str, Any]] = {}
    for name, block in core_of(of).layout.blocks.items():
        found[name] = {key: of[name].get(key) for key, slot in block.slots.items() if key in of[name].names}
        if block.form == "task":
            found[name]["weight"] = of[name].weight
    return found


def contradict(of: Controller, rng: np.random.Generator) -> None:
    """Two holds, of which some robots cannot keep both."""
    for name in ("hold", "hold_elbow"):
        target = of[name].target
        off = rng.normal(0.0, 0.02, 3) * (rng.random() < 0.5)
        of[name].target = pin.SE3(target.rotation, target.translation + off)


def give(batch: Batch, each: list[dict[str, dict[str, Any]]]) -> None:
    """One dictionary of values a robot."""
    batch.set(
        **{
            name: {
                key: [one[name][key] for one in each]
                if isinstance(value, pin.SE3)
                else np.array([one[name][key] for one in each])
                for key, value in own.items()
            }
            for name, own in each[0].items()
        }
    )


@pytest.mark.parametrize(("name", "threads"), covering(MADE, [1, 3]))
def test_ticks_are_those_of_single_controllers(name: str, threads: int) -> None:
    compare(
        MADE[name]("native" if name in ("arm", "torque") else COMPILED),
        count=130 if name == "arm" else 9,
        threads=threads,
    )


@pytest.mark.parametrize("name", ["arm", "levels"])
def test_without_a_compiler_too(name: str) -> None:
    compare(MADE[name]("vm"), count=3, threads=1, ticks=3)


def test_after_a_reset_no_torques_are_known() -> None:
    """Limits of how fast torques change do not count from 0."""
    single = problems.controller("panda").clone()
    batch, q = single.batch(2), single.stack.robot.neutral
    single.step(q)
    batch.step(q)
    single.reset(q)
    batch.reset(q)
    core = core_of(single)
    np.testing.assert_array_equal(batch.inputs[1], core.tick.state[core.context.memory.report :])


def test_a_policy_acts_on_each_robot() -> None:
    """Braking in conflicts, and a chain for answers without a certificate."""
    one = controller("conflicts", backend="native")
    one.policy = Policy(conflict="brake", chain=("cold",))
    statuses = compare(one, count=25, threads=2)
    assert Status.BRAKED in statuses
    assert Status.SOLVED in statuses


def compare(one: Controller, count: int, threads: int, ticks: int = 5) -> set[Status]:
    """A batch and single controllers with the same random values; the statuses that were seen."""
    rng, bot = np.random.default_rng(7), one.stack.robot
    seen: set[Status] = set()
    singles = [one.clone() for _ in range(count)]
    batch = one.batch(count, threads=threads)
    q = np.stack([near_limits(bot, rng) for _ in range(count)])
    batch.reset(q)
    for k, single in enumerate(singles):
        single.reset(q[k])
    for tick in range(ticks):
        if tick in (1, 3):
            for single in singles:
                aim(single, rng)
                if "hold_elbow" in single:
                    contradict(single, rng)
            give(batch, [values(single) for single in singles])
        v = rng.normal(size=(count, bot.nv)) if tick == 2 else None
        dt = 0.003 if tick == 4 else None
        found = batch.step(q, v, dt)
        wanted = [single.step(q[k], None if v is None else v[k], dt) for k, single in enumerate(singles)]
        for k, step in enumerate(wanted):
            own = step._data[: len(found[k]._data)]
            assert found[k]._data == own, f"robot {k}, tick {tick}: {found[k]} in place of {step}"
            np.testing.assert_allclose(found[k].q_next, step.q_next, rtol=0.0, atol=1e-12)
        assert found.statuses == [step.status for step in wanted]
        np.testing.assert_array_equal(found.v, [step.v for step in wanted])
        for name, residual in wanted[-1].residuals.items():
            np.testing.assert_array_equal(found.residuals[name][-1], residual.values)
        for name, margin in wanted[-1].margins.items():
            np.testing.assert_array_equal(found.margins[name][-1], margin)
        if one.stack.command == "torque":
            np.testing.assert_array_equal(found.torque, [step.torque for step in wanted])
        seen |= set(found.statuses)
        q = np.stack([pin.integrate(bot.model, now, 0.005 * v) for now, v in zip(q, found.v, strict=True)])
    return seen


@pytest.mark.parametrize("name", ["bare", "arm", "humanoid", "torque", "levels"])
def test_derivatives_are_those_of_single_steps(name: str) -> None:
    """By q, by the velocity that accelerations count from, and by targets; with and without rows that bind."""
    one, rng = MADE[name]("native" if name == "arm" else COMPILED), np.random.default_rng(3)
    bot = one.stack.robot
    batch = one.batch(3)
    q = np.stack([inside(bot, rng) for _ in range(3)])
    batch.reset(q)
    singles = [one.clone() for _ in range(3)]
    for k, single in enumerate(singles):
        single.reset(q[k])
        aim(single, rng)
    give(batch, [values(single) for single in singles])
    step = batch.step(q)
    while not step.solved.all():
        q[~step.solved] = np.stack([inside(bot, rng) for _ in range(int((~step.solved).sum()))])
        step = batch.step(q)
    assert name in ("bare", "torque") or any(step[k].binding for k in range(3))
    of = next(entry.name for entry in one.stack.tasks if "target" in one[entry.name].names)
    for asked in (("q", None), ("v", None), (of, "target"), (of, "weight")):
        found = step.derivative(*asked)
        wanted = np.stack([step[k].derivative(*asked) for k in range(3)])
        np.testing.assert_allclose(found, wanted, rtol=1e-4, atol=1e-5 * max(1.0, np.abs(wanted).max()))


def test_a_robot_whose_rows_gave_way_has_no_derivative() -> None:
    one = controller("conflicts", backend="native")
    batch = one.batch(2)
    batch.reset(robot("panda").neutral)
    batch.set(hold={"target": [pin.SE3.Identity(), one_pose()]})
    step = batch.step(robot("panda").neutral)
    assert not step.solved.all()
    with pytest.raises(SolverError, match="robot 0 is relaxed"):
        step.derivative("q")


def one_pose() -> pin.SE3:
    return robot("panda").pose(robot("panda").neutral, "panda_hand_tcp")


@pytest.fixture(scope="module")
def batch() -> Batch:
    """Three arms; tests leave it as it was."""
    return controller("arm", "panda", backend="vm").batch(3)


def test_values_of_one_are_those_of_all(batch: Batch) -> None:
    one, q = controller("arm", "panda", backend="vm"), robot("panda").neutral
    one.reset(q)
    batch.reset(q)
    pose = pin.SE3(np.eye(3), np.array([0.3, 0.1, 0.5]))
    batch.set(hand=pose, posture=q + 0.1, limits={}, ball={"pose": pose, "margin": 0.03})
    one["hand"].target, one["posture"].target = pose, q + 0.1
    one["ball"].set(pose=pose, margin=0.03)
    np.testing.assert_array_equal(batch.step(q).v, np.tile(one.step(q).v, (3, 1)))


def test_arrays_of_other_libraries(batch: Batch) -> None:
    """Anything with DLPack, here a wrapper that is no numpy array."""

    class Foreign:
        def __init__(self, array: np.ndarray) -> None:
            self.array = array

        def __dlpack__(self, **options: Any) -> Any:
            return self.array.__dlpack__(**options)

        def __dlpack_device__(self) -> Any:
            return self.array.__dlpack_device__()

    q = np.tile(robot("panda").neutral, (3, 1)) + 0.05 * np.arange(3)[:, None]
    batch.reset(q)
    batch.set(posture=q - 0.2)
    wanted = batch.step(q).v.copy()
    batch.reset(q)
    batch.set(posture=Foreign(q - 0.2))
    np.testing.assert_array_equal(batch.step(Foreign(q)).v, wanted)


Q = np.tile(np.array([0.0, 0.3, 0.0, -1.5, 0.0, 1.8, 0.7]), (3, 1))
BAD: dict[str, tuple[Callable[[Batch], object], type[Exception], str]] = {
    "count of robots": (lambda b: b.step(Q[:2]), ShapeError, "q"),
    "one q": (lambda b: b.step(np.where(np.arange(3)[:, None] == 1, np.nan, Q)), NotFiniteError, r"q\[1\]"),
    "v": (lambda b: b.step(Q, np.full((3, 7), np.inf)), NotFiniteError, r"v\[0\]"),
    "dt": (lambda b: b.step(Q, dt=1.0), RangeError, "dt"),
    "item": (lambda b: b.set(hnad=Q), UnknownNameError, "hand"),
    "value": (lambda b: b.set(hand={"taget": 1}), UnknownNameError, "target"),
    "no target": (lambda b: b.set(ball=1.0), ShapeError, "margin"),
    "poses": (lambda b: b.set(hand=np.zeros((3, 4, 4))), RotationError, r"hand.target\[0\]"),
    "count of poses": (lambda b: b.set(hand=[pin.SE3.Identity()] * 2), ShapeError, "hand.target"),
    "one pose of a list": (
        lambda b: b.set(hand=[np.eye(4), np.full((4, 4), np.nan), np.eye(4)]),
        NotFiniteError,
        r"hand.target\[1\]",
    ),
    "posture": (lambda b: b.set(posture=Q[:, :5]), ShapeError, "posture.target"),
    "margin": (lambda b: b.set(ball={"margin": np.array([0.1, np.nan, 0.1])}), NotFiniteError, r"ball.margin\[1\]"),
    "weight": (lambda b: b.set(hand={"weight": [1.0, -1.0, 1.0]}), RangeError, r"hand.weight\[1\]"),
    "weight of a constraint": (lambda b: b.set(ball={"weight": 1.0}), UnknownNameError, "ball.weight"),
    "robot": (lambda b: b.step(Q)[3], RangeError, "robot"),
    "torque": (lambda b: b.step(Q).torque, CommandError, "torque"),
}


@pytest.mark.parametrize("case", BAD)
def test_bad_values_are_refused_by_robot_and_change_nothing(batch: Batch, case: str) -> None:
    call, error, named = BAD[case]
    batch.reset(Q)
    batch.set(hand=np.eye(4), posture=Q, ball={"margin": 0.02}, limits={})
    before = batch.inputs.copy()
    with pytest.raises(error, match=named):
        call(batch)
    if case not in ("robot", "torque"):
        np.testing.assert_array_equal(batch.inputs, before)


def test_steps_of_a_batch_that_has_gone_on_give_arrays_only(batch: Batch) -> None:
    batch.reset(Q)
    old = batch.step(Q)
    v = old.v.copy()
    assert str(old[0].explain())
    batch.step(Q + 0.1)
    np.testing.assert_array_equal(old.v, v)
    with pytest.raises(SolverError, match="has gone on"):
        old[0]
    with pytest.raises(ValueError, match="read-only"):
        old.v[0, 0] = 1.0


@pytest.mark.parametrize("count", [0, -1, 1.5, True])
def test_a_batch_has_a_count(count: Any) -> None:
    with pytest.raises(RangeError, match="count"):
        controller("arm", "panda", backend="vm").batch(count)


def test_measured_distances_and_escapes_are_refused() -> None:
    stack = Stack(robot("panda"), 0.005).add(Obstacle(Box((0.1, 0.2, 0.3))), name="box")
    with pytest.raises(SolverError, match="box"):
        stack.compile(backend="vm").batch(2)
    one = controller("arm", "panda", backend="vm")
    one.policy = Policy(escape=True)
    with pytest.raises(SolverError, match="escape"):
        one.batch(2)


def test_a_batch_goes_on_in_a_forked_process() -> None:
    """The child has none of the threads that the parent's ticks were done by."""
    q = np.array([robot("panda").random(seed) for seed in range(130)])
    batch = bare("native").batch(len(q), threads=2)
    first = batch.step(q).v.copy()
    batch.reset(q)
    if not (child := os.fork()):
        signal.alarm(20)
        os._exit(0 if (batch.step(q).v == first).all() else 1)
    assert os.waitpid(child, 0)[1] == 0


def test_ctrl_c_ends_a_step_when_no_thread_is_at_work(monkeypatch: pytest.MonkeyPatch) -> None:
    q = np.array([robot("panda").random(seed) for seed in range(130)])
    batch = bare("native").batch(len(q), threads=2)
    run, begun, ended = Compiled._run, list[object](), list[object]()

    def slow(self: Compiled, tick: Any, *given: Any) -> bool:
        begun.append(tick)
        try:
            if len(begun) == 1:
                _thread.interrupt_main()
            time.sleep(0.02)
            return run(self, tick, *given)
        finally:
            ended.append(tick)

    with monkeypatch.context() as patched:
        patched.setattr(Compiled, "_run", slow)
        with pytest.raises(KeyboardInterrupt):
            batch.step(q)
        assert set(map(id, begun)) == set(map(id, ended))
    batch.reset(q)
    assert (batch.step(q).v == bare("native").batch(len(q), threads=1).step(q).v).all()
