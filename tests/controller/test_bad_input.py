"""Bad input at run time: a typed error that names field, value and choices, and a controller that never noticed it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

from tests.backends import COMPILED
from tests.controller.stacks import DT, robot
from tests.controller.twins import BACKENDS, POSE, TURN, make, next_ticks, prepare, state
from tests.repeats import ALL, MORE, covering
from wbc import Controller, WbcError
from wbc.errors import NotFiniteError, RangeError, RotationError, ShapeError, UnknownAttributeError, UnknownNameError

SKEWED = TURN + 1e-3 * np.eye(3)
#: Of calls before the first tick every so many is tried
FRESH = 1 if MORE >= ALL else 9
NAN, INF = np.full(7, np.nan), np.array([0.0, np.inf, 0.0, 0.0, 0.0, 0.0, 0.0])


def same(a: Any, b: Any) -> bool:
    """The error carries the value that was given (a float64 copy of an array is the same value)."""
    if a is b:
        return True
    try:
        return bool(np.array_equal(np.asarray(a, dtype=float), np.asarray(b, dtype=float), equal_nan=True))
    except (TypeError, ValueError):
        return bool(a == b)


@dataclass(frozen=True, eq=False)
class Case:
    """What is called, with which value, and the error that must come: its type, field, and first choice."""

    call: Callable[[Controller, Any], Any]
    value: Any
    error: type[WbcError]
    field: str
    nearest: str | None = None
    shown: Any = None


def put(name: str, key: str) -> Callable[[Controller, Any], Any]:
    return lambda controller, value: setattr(controller[name], key, value)


def good(controller: Controller) -> np.ndarray:
    return controller.stack.robot.neutral


def stepped(argument: str) -> Callable[[Controller, Any], Any]:
    """step with one bad argument, the others good and unlike the present state."""

    def call(controller: Controller, value: Any) -> Any:
        arguments = {"q": good(controller), "v": np.full(controller.stack.robot.nv, 0.2), "dt": 0.7 * DT}
        return controller.step(**(arguments | {argument: value}))

    return call


def only_q(controller: Controller, value: Any) -> Any:
    """The fast path: neither v nor dt."""
    return controller.step(value)


def q_and_v(controller: Controller, value: Any) -> Any:
    return controller.step(good(controller), value)


def bad_q_with_v(controller: Controller, value: Any) -> Any:
    return controller.step(value, np.full(controller.stack.robot.nv, 0.2))


def _arrays(argument: str, call: Callable[[Controller, Any], Any]) -> dict[str, Case]:
    """What is no vector of seven finite numbers."""
    values: dict[str, tuple[Any, type[WbcError]]] = {
        "too short": (np.zeros(6), ShapeError),
        "column": (np.zeros((7, 1)), ShapeError),
        "scalar": (0.0, ShapeError),
        "text": ("home", ShapeError),
        "complex": (np.zeros(7, dtype=complex), ShapeError),
        "ragged": ([[0.0], [0.0, 1.0]], ShapeError),
        "NaN": (NAN, NotFiniteError),
        "NaN float32": (NAN.astype(np.float32), NotFiniteError),
        "inf": (INF, NotFiniteError),
        "-inf in a list": ((-INF).tolist(), NotFiniteError),
    }
    return {f"{call.__name__} {argument} {k}": Case(call, v, e, argument) for k, (v, e) in values.items()}


STEP = {
    **_arrays("q", only_q),
    **_arrays("q", bad_q_with_v),
    **_arrays("v", q_and_v),
    **_arrays("q", stepped("q")),
    **_arrays("v", stepped("v")),
    "no q": Case(only_q, None, ShapeError, "q"),
    "dt zero": Case(stepped("dt"), 0.0, RangeError, "dt"),
    "dt integer zero": Case(stepped("dt"), 0, RangeError, "dt"),
    "dt negative": Case(stepped("dt"), -DT, RangeError, "dt"),
    "dt below range": Case(stepped("dt"), 0.249 * DT, RangeError, "dt"),
    "dt above range": Case(stepped("dt"), 2.001 * DT, RangeError, "dt"),
    "dt NaN": Case(stepped("dt"), np.nan, NotFiniteError, "dt"),
    "dt inf": Case(stepped("dt"), np.inf, NotFiniteError, "dt"),
    "dt array": Case(stepped("dt"), np.array([DT]), ShapeError, "dt"),
    "dt text": Case(stepped("dt"), "fast", ShapeError, "dt"),
    **{
        f"reset {argument} {kind}": Case(
            lambda c, value, a=argument: c.reset(**({"q": good(c)} | {a: value})), value, error, argument
        )
        for argument in ("q", "v")
        for kind, value, error in (
            ("shape", np.zeros(8), ShapeError),
            ("NaN", NAN, NotFiniteError),
            ("inf", INF, NotFiniteError),
            ("text", "home", ShapeError),
        )
    },
}

#: What the walk over the registry in test_switches_of_every_class.py does not ask
VALUES = {
    "pose no rotation": Case(
        put("hand", "target"), pin.SE3(SKEWED, POSE.translation), RotationError, "hand.target", shown=SKEWED
    ),
    "pose mirrored": Case(
        put("hand", "target"), np.diag([1.0, 1.0, -1.0, 1.0]), RotationError, "hand.target", shown=np.diag([1.0, 1, -1])
    ),
    "pose last row": Case(put("hand", "target"), np.eye(4) + np.eye(4)[::-1], RotationError, "hand.target"),
    "pose quaternion": Case(
        put("hand", "target"), [0, 0, 0, 0, 0, 0, 1.1], RotationError, "hand.target", shown=[0, 0, 0, 1.1]
    ),
    "pose zero quaternion": Case(put("hand", "target"), np.zeros(7), RotationError, "hand.target", shown=np.zeros(4)),
    "pose NaN": Case(put("hand", "target"), pin.SE3(TURN, NAN[:3]), NotFiniteError, "hand.target", shown=NAN[:3]),
    "pose NaN matrix": Case(put("hand", "target"), np.full((4, 4), np.nan), NotFiniteError, "hand.target"),
    "position inf": Case(put("place", "target"), (0.0, 0.0, np.inf), NotFiniteError, "place.target"),
    "rotation matrix": Case(put("turn", "target"), SKEWED, RotationError, "turn.target"),
    "rotation scaled": Case(put("turn", "target"), 2 * TURN, RotationError, "turn.target"),
    "rotation quaternion": Case(put("turn", "target"), (0, 0, 0, 0.99), RotationError, "turn.target"),
    "rotation NaN": Case(put("turn", "target"), NAN[:4], NotFiniteError, "turn.target"),
    "angle shape": Case(put("plane", "target"), (1.0,), ShapeError, "plane.target"),
    "configuration inf": Case(put("posture", "target"), INF, NotFiniteError, "posture.target"),
    "weight negative": Case(put("hand", "weight"), -1e-9, RangeError, "hand.weight"),
    "weight NaN": Case(put("hand", "weight"), np.nan, NotFiniteError, "hand.weight"),
    "weight inf": Case(put("hand", "weight"), np.inf, NotFiniteError, "hand.weight"),
    "weight vector": Case(put("hand", "weight"), np.ones(6), ShapeError, "hand.weight"),
    "gain negative": Case(put("hand", "gain"), -2, RangeError, "hand.gain"),
    "scale above 1": Case(put("limits", "velocity_scale"), 1.5, RangeError, "limits.velocity_scale"),
    "rate times dt": Case(put("ball", "rate"), 1.001 / (2 * DT), RangeError, "ball.rate"),
    "rate zero": Case(put("ball", "rate"), 0.0, RangeError, "ball.rate"),
    "mask negative": Case(put("hand", "mask"), (1, 1, -1, 1, 1, 1), RangeError, "hand.mask[2]", shown=-1.0),
    "mask NaN": Case(put("hand", "mask"), NAN[:6], NotFiniteError, "hand.mask"),
    "mask one negative": Case(put("hand", "mask"), -0.5, RangeError, "hand.mask[0]", shown=-0.5),
    "mask of bounds": Case(put("limits", "mask"), (1, 1, 1, 0.5, 1, 1, 1), RangeError, "limits.mask[3]", shown=0.5),
    "mask of bounds negative": Case(put("limits", "mask"), -1, RangeError, "limits.mask[0]", shown=-1.0),
    "mask of margins": Case(put("ball", "mask"), 2, RangeError, "ball.mask[0]", shown=2.0),
    "enabled number": Case(put("hand", "enabled"), 0.5, ShapeError, "hand.enabled"),
}


def write_one(item: str) -> Callable[[Controller, Any], Any]:
    return lambda controller, name: setattr(controller[item], name, 1.0)


def read_item(controller: Controller, name: Any) -> Any:
    return controller[name]


def compile_with(option: str) -> Callable[[Controller, Any], Any]:
    return lambda controller, name: controller.stack.compile(**{option: name})


NAMES = {
    "item": Case(read_item, "hnad", UnknownNameError, "item", "hand"),
    "item number": Case(read_item, 3, UnknownNameError, "item"),
    "item list": Case(read_item, ["hand"], UnknownNameError, "item", "hand"),
    "write": Case(write_one("hand"), "targt", UnknownAttributeError, "hand.targt", "target"),
    "read": Case(
        lambda c, name: getattr(c["hand"], name), "feedforwrd", UnknownAttributeError, "hand.feedforwrd", "feedforward"
    ),
    "write private": Case(write_one("hand"), "_mask", UnknownAttributeError, "hand._mask", "mask"),
    "rate of a task": Case(write_one("hand"), "rate", UnknownAttributeError, "hand.rate", "target"),
    "weight of a constraint": Case(write_one("ball"), "weight", UnknownAttributeError, "ball.weight"),
    "gain of bounds": Case(write_one("limits"), "gain", UnknownAttributeError, "limits.gain"),
    "attribute": Case(
        lambda c, name: setattr(c, name, 1.0), "polcy", UnknownAttributeError, "Controller.polcy", "policy"
    ),
    "solver": Case(compile_with("solver"), "dapq", UnknownNameError, "solver", "daqp"),
    "solver number": Case(compile_with("solver"), 1, UnknownNameError, "solver"),
    "backend": Case(compile_with("backend"), "natve", UnknownNameError, "backend", "native"),
    "backend None": Case(compile_with("backend"), None, UnknownNameError, "backend"),
}

PANDA = STEP | {f"value {k}": v for k, v in VALUES.items()} | {f"name {k}": v for k, v in NAMES.items()}


def off_manifold(name: str, at: slice, factor: float) -> np.ndarray:
    q = robot(name).neutral.copy()
    q[at] *= factor
    return q


MANIFOLD = {
    f"{name} {label} {what}": (name, Case(call, off_manifold(name, at, factor), error, field))
    for name, at, places in (
        ("talos", slice(3, 7), ((only_q, "q"), (bad_q_with_v, "q"), (put("posture", "target"), "posture.target"))),
        ("kinova", slice(0, 2), ((stepped("q"), "q"), (lambda c, q: c.reset(q), "q"), (only_q, "q"))),
    )
    for label, factor, error in (
        ("long", 1.0 + 2e-6, RotationError),
        ("short", 0.9, RotationError),
        ("zero", 0.0, RotationError),
        ("NaN", np.nan, NotFiniteError),
    )
    for what, (call, field) in enumerate(places)
}


def check(controller: Controller, wanted: Callable[[], list[bytes]], case: Case) -> None:
    """The error is as declared; state and next answers are those of a twin that never saw the call, bit for bit."""
    before = state(controller)
    with pytest.raises(WbcError) as caught:
        case.call(controller, case.value)
    error = caught.value
    assert type(error) is case.error
    assert error.field == case.field
    assert same(error.value, case.value if case.shown is None else case.shown)
    assert str(error).startswith(f"{case.field}: ")
    if issubclass(case.error, UnknownNameError):
        assert error.choices
        assert case.nearest is None or error.choices[0] == case.nearest
    assert state(controller) == before
    assert next_ticks(controller) == wanted()


@cache
def running(name: str, backend: str) -> list[tuple[Controller, Controller]]:
    """A controller that sees bad calls, and its twin; kept from case to case, as what a case leaves is compared."""
    return []


def check_running(name: str, backend: str, case: Case) -> None:
    pairs = running(name, backend)
    if not pairs:
        pairs.append((make(name, backend), make(name, backend)))
        for one in pairs[0]:
            prepare(one, ticks=2)
    pair = pairs.pop()
    check(pair[0], lambda: next_ticks(pair[1]), case)
    pairs.append(pair)  # not where it failed: the next case starts with new ones


def fresh(name: str) -> Controller:
    """One whose values are set, before its first tick."""
    one = make(name, COMPILED)
    prepare(one, ticks=0)
    return one


@cache
def first_ticks(name: str) -> list[bytes]:
    """What one answers that never saw a bad call."""
    return next_ticks(fresh(name))


def check_fresh(name: str, case: Case) -> None:
    check(fresh(name), lambda: first_ticks(name), case)


@pytest.mark.parametrize(
    ("case", "backend"), [*covering(STEP, BACKENDS), *((k, BACKENDS[0]) for k in PANDA if k not in STEP)]
)
def test_refused_after_some_ticks(case: str, backend: str) -> None:
    check_running("panda", backend, PANDA[case])


@pytest.mark.parametrize("case", [k for k in PANDA if not k.startswith("name")][::FRESH])
def test_refused_before_the_first_tick(case: str) -> None:
    check_fresh("panda", PANDA[case])


@pytest.mark.parametrize(("case", "backend"), covering(MANIFOLD, BACKENDS))
def test_off_the_manifold(case: str, backend: str) -> None:
    check_running(MANIFOLD[case][0], backend, MANIFOLD[case][1])


@pytest.mark.parametrize("case", [*MANIFOLD][::FRESH])
def test_off_the_manifold_before_the_first_tick(case: str) -> None:
    check_fresh(*MANIFOLD[case])
