"""Targets in, command out: one call does what setting and stepping do, and refuses what they refuse."""

from __future__ import annotations

import gc
import inspect
import pickle
import sys
import weakref
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

from tests.backends import COMPILED
from tests.controller.stacks import DT, everything
from tests.stack import small
from wbc import Controller, Stack, Step, WbcError, robots
from wbc.controller import core_of
from wbc.tasks import EndEffector, Posture
from wbc.tick import native


def pair(name: str, **how: Any) -> tuple[Controller, Controller]:
    stack = everything(name)
    return tuple(stack.compile(backend=COMPILED, **how) for _ in range(2))  # type: ignore[return-value]


def targets(controller: Controller, rng: np.random.Generator) -> dict[str, Any]:
    """A target of every kind that there is, in turns as arrays, lists and poses."""
    robot, out = controller.stack.robot, dict[str, Any]()
    for entry in controller.stack.tasks:
        if "target" not in controller[entry.name].names:
            continue
        value = controller[entry.name].target
        if isinstance(value, pin.SE3):
            pose = value * pin.exp6(0.1 * rng.normal(size=6))
            out[entry.name] = pose if rng.uniform() < 0.5 else pose.homogeneous
        elif np.shape(value) == (3, 3):
            out[entry.name] = value @ pin.exp3(0.1 * rng.normal(size=3))
        elif np.shape(value) == (robot.nq,):
            out[entry.name] = robot.integrate(value, 0.1 * rng.normal(size=robot.nv))
        else:
            given = value + 0.1 * rng.normal(size=np.shape(value))
            out[entry.name] = given if rng.uniform() < 0.8 or not np.shape(value) else list(given)
    return out


@pytest.mark.parametrize("name", ["panda", "ur5"])
def test_it_is_what_setting_and_stepping_are(name: str) -> None:
    """Also with a measured velocity, another dt, what relaxes or is capped, resets, and without targets."""
    together, apart = pair(name)
    rng, q = np.random.default_rng(3), together.stack.robot.neutral
    for controller in (together, apart):
        controller.step(q)
    for k in range(60):
        given = targets(apart, rng) if k % 3 else {}
        # In any order, also names that were made at run time, with and without some of them
        names = [rng.permutation(list(given)).tolist(), list(given)[k % 2 :], list(given)][k % 4 % 3]
        given = {"".join(list(name)): given[name] for name in names}
        for controller in (together, apart):
            controller.iteration_cap = 1 if k % 11 == 10 else None
        more = {"v": 0.1 * rng.normal(size=together.stack.robot.nv)} if k % 7 == 6 else {}
        more |= {"dt": 1.5 * DT} if k % 5 == 4 else {}
        step = together.step(q, **more, **given)
        apart.set(**given)
        wanted = apart.step(q, **more)
        assert step._data == wanted._data
        q = together.stack.robot.integrate(q, step.v, DT)
        if k == 30:
            together.reset(q)
            apart.reset(q)


def test_arrays_that_are_not_as_known_are_asked_of_numpy(monkeypatch: pytest.MonkeyPatch) -> None:
    """What code in C knows of numpy's memory spares time and changes nothing: others of the same numbers, and what is
    refused.
    """
    assert (id(np.ndarray), id(np.dtype(np.float64))) == native.PLAIN_ARRAYS
    known = everything("panda").compile(backend=COMPILED)
    monkeypatch.setattr(native, "PLAIN_ARRAYS", (0, 0))
    asked = everything("panda").compile(backend=COMPILED)
    q, name = known.stack.robot.neutral, targets_of_poses(known)[0]
    assert known.step(q)._data == asked.step(q)._data
    pose = known[name].target.homogeneous
    for _ in range(3):
        assert known.step(q, **{name: pose})._data == asked.step(q, **{name: pose})._data
    for bad in (q[:-1], q.reshape(1, -1), q.astype(">f4")[:-1], np.zeros(())):
        for controller in (known, asked):
            with pytest.raises(WbcError):
                controller.step(bad)
    for alike in (np.repeat(q, 2)[::2], q.astype(">f8"), q.view(np.rec.recarray), list(q)):
        assert known.step(alike)._data == asked.step(alike)._data


def targets_of_poses(controller: Controller) -> list[str]:
    core = core_of(controller)
    return [
        n for n, block in core.layout.blocks.items() if "target" in block.slots and block.slots["target"].size == 12
    ]


def test_what_is_bad_changes_nothing() -> None:
    controller, _ = pair("panda")
    robot = controller.stack.robot
    q = robot.neutral
    (name, *_) = targets_of_poses(controller)
    good, mirrored, endless = (np.eye(4) for _ in range(3))
    good[:3, 3] = 0.4
    mirrored[0, 0] = -1.0
    endless[0, 3] = np.nan
    controller.step(q, **{name: good})
    controller.step(q, **{name: good})
    before = core_of(controller).tick.state.tobytes()
    bad: list[tuple[Any, dict[str, Any]]] = [
        (q, {name: mirrored}), (q, {name: endless}), (q, {name: np.eye(3)}), (q, {name: "there"}),
        (q, {name: np.ones(16)}), (q, {name: np.eye(4, dtype=complex)}), (q, {name: good, "nobody": good}),
        (np.full(robot.nq, np.nan), {name: good}), (q[:-1], {name: good}), ("q", {name: good}), (q[:, None], {}),
        (None, {}), (q + np.inf, {}),
    ]  # fmt: skip
    for configuration, given in bad:
        with pytest.raises(WbcError):
            controller.step(configuration, **given)
        assert core_of(controller).tick.state.tobytes() == before, (configuration, given)
    with pytest.raises(WbcError):
        controller.step(q, dt=1e9, **{name: good})
    assert core_of(controller).tick.state.tobytes() == before


@pytest.mark.parametrize("backend", sorted({COMPILED, "vm"}))
@pytest.mark.parametrize(
    ("name", "base", "frame"),
    [("panda", "fixed", "panda_hand"), ("talos", "floating", "base_link"), ("tiago", "planar", "base_link")],
)
def test_the_next_configuration_is_that_of_the_robot(name: str, base: str, frame: str, backend: str) -> None:
    """By C where it knows the joints: of arms to the bits, of free bases also where they turn far in a tick."""
    robot, rng, turned = robots.load(name, base=base), np.random.default_rng(5), 0.0
    stack = Stack(robot, DT).add(Posture(), name="posture", weight=1e-3).add(EndEffector(frame), name="frame")
    controller = stack.compile(backend=backend)
    controller["frame"].gain = 1.0 / DT
    for k in range(40):
        q = robot.random(k)
        controller.step(q)
        target = robot.pose(q, frame) * pin.exp6(rng.normal(size=6) * 10.0 ** rng.uniform(-9.0, 0.3))
        given = {"frame": target, "posture": robot.random(k + 100)}
        step = controller.step(q, **given, **({"dt": DT} if k % 4 == 3 else {}))
        later = robot.integrate(q, step.v, DT)
        np.testing.assert_allclose(step.q_next, later, rtol=0.0, atol=0.0 if base == "fixed" else 1e-14)
        np.testing.assert_array_equal(pickle.loads(pickle.dumps(step)).q_next, step.q_next)
        assert not step.q_next.flags.writeable
        turned = max(turned, float(np.linalg.norm(step.v[3:6]) * DT))
    assert base != "floating" or turned > 0.5


def test_a_step_keeps_what_its_arrays_show() -> None:
    """Arrays are views of the step's copy, read-only, and outlive it; nothing is held longer."""
    controller, _ = pair("panda")
    q = controller.stack.robot.neutral
    step = controller.step(q)
    data, context = step._data, core_of(controller).context
    before, doubles = (sys.getrefcount(data), sys.getrefcount(context)), sys.getrefcount(np.dtype(float))
    arrays = [(step.v, step.q_next) for _ in range(50)]
    for v, later in arrays:
        assert np.array_equal(v, np.frombuffer(data, float, len(v)))
        assert v.dtype is np.dtype(float)
        assert np.array_equal(later, np.frombuffer(data, float, -1, len(data) - 8 * len(q)))
        for array in (v, later):
            assert array.base is data
            assert not array.flags.writeable
            with pytest.raises(ValueError, match="read-only"):
                array[0] = 1.0
            with pytest.raises(ValueError, match="WRITEABLE"):
                array.flags.writeable = True
    del arrays, v, later, array
    for _ in range(50):
        controller.step(q)
    assert (sys.getrefcount(data), sys.getrefcount(context)) == before
    assert abs(sys.getrefcount(np.dtype(float)) - doubles) < 50  # others come and go; 100 arrays were made
    for bad in (data[:8], bytearray(data), None):
        with pytest.raises(TypeError):
            context.v_of(bad)  # type: ignore[arg-type]
    again = pickle.loads(pickle.dumps(step))
    assert np.array_equal(again.v, step.v)
    assert np.array_equal(again.q_next, step.q_next)


def test_step_is_the_method_that_it_stands_for() -> None:
    """Its name, text and signature; the same bits; and it outlives the name of its controller."""
    one, other = small.stack().compile(backend="vm"), small.stack().compile(backend="vm")
    method, step, q = Controller.step, one.step, np.array(small.Q)
    assert (step.__name__, step.__doc__) == (method.__name__, method.__doc__)
    assert list(inspect.signature(step).parameters) == list(inspect.signature(method).parameters)[1:]
    del one
    gc.collect()
    for k in range(4):
        given = {"hand": np.array([0.1 * k, 0.4, 0.0])} if k else {}
        assert step(q, **given)._data == method(other, q, **given)._data
    kept = weakref.ref(step.__self__[1].__self__)
    del step
    gc.collect()
    assert kept() is None, "nothing else holds the controller"


def test_a_step_of_a_class_made_from_controllers_is_its_own() -> None:
    class Counting(Controller):
        count = 0

        def step(self, *given: object, **targets: object) -> Step:
            self.count += 1
            return super().step(*given, **targets)

    made = small.stack().compile(backend="vm")
    other = Counting(made.stack, made._artifact, made.solver, core_of(made).assembly.twin())
    assert other.step(np.array(small.Q))._data == made.step(np.array(small.Q))._data
    assert other.count == 1
