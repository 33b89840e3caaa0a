"""What is welcome as input, and what must be said before the first tick."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, ClassVar

import casadi as ca
import numpy as np
import pinocchio as pin
import pytest

from tests.backends import COMPILED, IN_PYTHON
from tests.controller.stacks import DT, inside, robot
from tests.controller.twins import BACKENDS, make, next_ticks, state
from wbc import Stack
from wbc.controller import core_of
from wbc.errors import NotFiniteError, RotationError, ShapeError, SolverError
from wbc.robot import Robot
from wbc.symbolic.tracer import Tracer
from wbc.tasks import (
    Elbow,
    FrameVelocityLimit,
    Input,
    JointCoupling,
    Limit,
    Posture,
    WorkspaceBox,
    WorkspacePolyhedron,
)
from wbc.tasks.base import Item, Row, Task, Values

KINDS: dict[str, Callable[[np.ndarray], Any]] = {
    "float32": lambda x: x.astype(np.float32),
    "list": lambda x: x.tolist(),
    "tuple": lambda x: tuple(x.tolist()),
    "list of numpy scalars": list,
    "memory": memoryview,
    "every second": lambda x: np.repeat(x, 2)[::2],
    "reversed": lambda x: x[::-1].copy()[::-1],
    "column of a matrix": lambda x: np.column_stack([x, x])[:, 0],
    "big-endian": lambda x: x.astype(">f8"),
    "read-only": lambda x: np.frombuffer(x.tobytes()),
    "subclass": lambda x: x.view(type("Sub", (np.ndarray,), {})),
}


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("kind", KINDS)
def test_any_kind_of_real_numbers_is_the_same_answer(kind: str, backend: str) -> None:
    controller, twin, spell = make("panda", backend), make("panda", backend), KINDS[kind]
    rng = np.random.default_rng(5)
    for arguments in ("q", "qv", "qvd", "q"):
        # numbers that float32 holds exactly
        q, v = (x.astype(np.float32).astype(float) for x in (inside(robot("panda"), rng), rng.uniform(-0.1, 0.1, 7)))
        q_given, v_given = q.copy(), v.copy()
        dt = (np.float32(0.0078125), 0.0078125) if "d" in arguments else (None, None)
        one = controller.step(spell(q), spell(v) if "v" in arguments else None, dt[0])
        other = twin.step(q, v if "v" in arguments else None, dt[1])
        assert one._data == other._data
        assert np.array_equal(q, q_given)
        assert np.array_equal(v, v_given)
    controller.reset(spell(q), spell(v))
    twin.reset(q, v)
    controller["posture"].target, twin["posture"].target = spell(q), q
    controller["hand"].mask, twin["hand"].mask = spell(np.arange(6.0)), np.arange(6.0)
    assert controller.step(spell(q))._data == twin.step(q)._data


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("kind", [int, np.int8, np.int32, np.uint16, np.int64, bool])
def test_whole_numbers_are_welcome(kind: type, backend: str) -> None:
    controller, twin = make("panda", backend), make("panda", backend)
    q = np.array([0, 1, 0, 1, 0, 1, 1]) - (np.array([0, 0, 0, 2, 0, 0, 0]) if np.dtype(kind).kind == "i" else 0)
    assert controller.step(q.astype(kind), np.ones(7, kind))._data == twin.step(q.astype(float), np.ones(7))._data
    place = np.array([1, 0, 1])
    controller["place"].target, twin["place"].target = place.astype(kind), place.astype(float)
    controller["hand"].weight, twin["hand"].weight = kind(1), 1.0
    controller["hand"].enabled, twin["hand"].enabled = 0, False
    controller["limits"].mask, twin["limits"].mask = np.ones(7, kind), np.ones(7)
    assert controller.step(q.astype(kind).tolist())._data == twin.step(q.astype(float))._data
    assert controller.step(q.astype(kind))._data == twin.step(q.astype(float))._data


@pytest.mark.parametrize(
    ("item", "name"),
    [
        (WorkspaceBox("panda_hand", -2.0, 2.0), "lower"),
        (WorkspaceBox("panda_hand", -2.0, 2.0), "upper_rate"),
        (Limit(Elbow("panda_link4"), upper=2.0, only="z"), "upper"),
        (FrameVelocityLimit("panda_hand", linear=(1.0, np.inf, 2.0)), "linear"),
        (JointCoupling([{"panda_joint1": 1.0}, {"panda_joint2": 1.0, "panda_joint3": 2.0}]), "target"),
        (WorkspacePolyhedron("panda_hand", [(0, 0, 1), (1, 0, 0)], -2.0), "offsets"),
    ],
    ids=lambda given: given if isinstance(given, str) else type(given).__name__,
)
def test_one_number_counts_for_all_where_the_declaration_takes_one(item: Item, name: str) -> None:
    controller = Stack(robot("panda"), DT).add(item, name="it").add(Posture(), name="posture").compile(backend="vm")
    controller.reset(robot("panda").neutral)
    count = controller["it"].get(name).size
    for one in (0.25, np.float32(0.25), np.array(0.25)):
        controller["it"].set(**{name: one})
        assert np.array_equal(controller["it"].get(name), np.full(count, 0.25))
    batch = controller.batch(3)
    batch.set(it={name: 0.5})
    single = controller.clone()
    single["it"].set(**{name: np.full(count, 0.5)})
    q = np.array(robot("panda").neutral)
    assert np.array_equal(batch.step(np.tile(q, (3, 1))).v, np.tile(single.step(q).v, (3, 1)))
    for wrong in (np.full(count + 1, 0.25), "0.25", np.nan):
        with pytest.raises((ShapeError, NotFiniteError), match=f"it.{name}"):
            controller["it"].set(**{name: wrong})


# --- before the first configuration -----------------------------------------------------------------


@pytest.mark.parametrize("item", ["hand", "place", "turn", "plane", "posture"])
def test_a_value_that_waits_for_the_first_configuration_cannot_be_read(item: str) -> None:
    controller, twin = make("panda", COMPILED), make("panda", COMPILED)
    before = state(controller)
    for read in (lambda: controller[item].target, controller.qp):
        with pytest.raises(SolverError, match="first configuration") as caught:
            read()
        assert caught.value.field in (f"{item}.target", "qp")
        assert caught.value.value is None
    assert state(controller) == before
    assert next_ticks(controller) == next_ticks(twin)
    assert np.isfinite(np.ravel(getattr(controller[item].target, "homogeneous", controller[item].target))).all()
    assert np.isfinite(controller.qp().H).all()


@dataclass(frozen=True)
class Undecided(Task):
    """A joint follows a target that has no default and that no configuration gives."""

    abstract: ClassVar[bool] = True

    def inputs(self, robot: Robot) -> tuple[Input, ...]:
        return (Input("target", unit="rad"),)

    def rows(self, robot: Robot) -> tuple[Row, ...]:
        return (Row("joint", "rad"),)

    def error(self, robot: Robot, kin: Tracer, inputs: Values) -> ca.SX:
        return kin.q[0] - inputs["target"]


def test_step_before_a_target_without_default() -> None:
    declared = Stack(robot("panda"), DT).add(Posture(), name="posture").add(Undecided(), name="joint")
    controller, twin = declared.compile(solver=IN_PYTHON), declared.compile(solver=IN_PYTHON)
    before, q = state(controller), robot("panda").neutral
    for call in (lambda: controller.step(q), lambda: controller.step(q, np.ones(7), DT), lambda: controller.reset(q)):
        with pytest.raises(SolverError, match="no default value; set it before step") as caught:
            call()
        assert caught.value.field == "joint.target"
        assert state(controller) == before
    with pytest.raises(SolverError, match="first configuration"):
        _ = controller["posture"].target
    for one in (controller, twin):
        one["joint"].target = 0.5
    assert controller.step(q)._data == twin.step(q)._data
    assert controller.step(q).v[0] * np.sign(0.5 - q[0]) > 0.0


def test_poses_are_taken_and_refused_alike_by_both_backends() -> None:
    """The native check of a pose that is set every tick, against the one in Python."""
    native, vm = make("panda", COMPILED), make("panda", IN_PYTHON)
    slot = core_of(native).layout.blocks["hand"].slots["target"]
    rng, taken = np.random.default_rng(11), 0
    for size in (0.0, 1e-8, 1e-7, 2e-7, 3e-7, 4e-7, 6e-7, 1e-6, 1e-3):
        for _ in range(20):
            pose = pin.SE3.Random().homogeneous
            pose[:3] += size * rng.standard_normal((3, 4))
            before, refused = core_of(native).tick.p[slot.span].copy(), []
            for controller in (native, vm):
                try:
                    controller["hand"].target = pose
                except RotationError:
                    refused.append(controller)
            assert len(refused) in (0, 2)
            written = before if refused else pose[:3].ravel(order="F")
            assert np.array_equal(core_of(native).tick.p[slot.span], written)
            taken += not refused
            # the same numbers in another order in memory
            if not refused:
                native["hand"].target = np.asfortranarray(pose)
                assert np.array_equal(core_of(native).tick.p[slot.span], written)
    assert 60 < taken < 170
    for spoil in ((3, 3, 2.0), (3, 0, 1e-9), (0, 3, np.nan), (1, 3, np.inf), (0, 0, np.nan)):
        bad = np.eye(4)
        bad[spoil[0], spoil[1]] = spoil[2]
        with pytest.raises((RotationError, NotFiniteError)):
            native["hand"].target = bad
    mirrored = np.diag([1.0, 1.0, -1.0, 1.0])
    with pytest.raises(RotationError):
        native["hand"].target = mirrored
    assert np.array_equal(core_of(native).tick.p[slot.span], before if refused else written)
