"""Run-time values of one item as flat numbers and as the symbols that its expressions receive."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any, get_args

import casadi as ca
import numpy as np

from wbc import validation
from wbc.errors import BoundsError, DuplicateNameError, NotFiniteError, RangeError, ShapeError, UnknownNameError
from wbc.multibody import is_pose, own
from wbc.quick_dataclasses import dataclass
from wbc.robot import Robot
from wbc.shapes import FAR
from wbc.symbolic.kinematics import Pose
from wbc.tasks.base import Input, Kind
from wbc.validation import Array

#: Inputs that every item has, or may have, without declaring them.
RESERVED = ("gain", "weight", "enabled", "mask", "rate")
#: Directions longer than this, and shorter than its inverse, are scaled as they are
ORDINARY = 1e-9


def with_accelerations(robot: Robot, declared: Sequence[Input]) -> list[Input]:
    """The inputs, and one for the second time derivative of every input that names a rate, as the ``rate`` of that
    rate: zero until it is set. ``feedforward`` and ``velocity`` have ``acceleration``, ``x_velocity`` and ``x_rate``
    have ``x_acceleration``, any other name ``name_acceleration``. That of a direction is what turns it: what keeps
    it at unit length comes by itself.
    """
    rates = {i.rate for i in declared if i.rate is not None}
    rates -= {i.rate for i in declared if i.name in rates}  # second derivatives that are declared
    out, more = [], []
    for i in declared:
        if i.name not in rates or i.rate is not None or i.sensed:
            out.append(i)
            continue
        unit = ", ".join(f"{u}^2" if u.endswith("/s") else f"{u or '1'}/s" for u in i.unit.split(", "))
        zero = np.zeros(size(robot, i)) if i.size or i.kind != "vector" else 0.0
        out.append(replace(i, rate=acceleration_name(i.name)))
        more.append(Input(acceleration_name(i.name), i.kind, unit, i.size, zero))
    return [*out, *more]


def acceleration_name(rate: str) -> str:
    """Name of the input with the time derivative of an input that is a rate, see :func:`with_accelerations`."""
    for end in ("feedforward", "_velocity", "velocity", "_rate"):
        if rate.endswith(end):
            stem = rate.removesuffix(end)
            return f"{stem}_acceleration" if stem else "acceleration"
    return f"{rate}_acceleration"


def size(robot: Robot, declared: Input) -> int:
    """How many numbers the input takes in a buffer."""
    fixed = {"pose": 12, "rotation": 9, "configuration": robot.nq, "tangent": robot.nv}
    return fixed.get(declared.kind, max(1, declared.size))


def rate_size(robot: Robot, declared: Input) -> int:
    """How many numbers the input's time derivative has."""
    fixed = {"pose": 6, "rotation": 3, "configuration": robot.nv}
    return fixed.get(declared.kind, size(robot, declared))


def is_plain(declared: Input) -> bool:
    """Whether any finite numbers, a vector of them, will do."""
    free = declared.low == -math.inf and declared.high == math.inf and not (declared.direction or declared.sensed)
    return free and (declared.kind == "tangent" or (declared.kind == "vector" and declared.size > 0))


def flat(robot: Robot, field: str, declared: Input, value: Any) -> Array:
    """A value as the user writes it, checked, as the numbers of the buffer.

    Raises:
        ShapeError, NotFiniteError, RotationError, RangeError: it is no value of this input.
    """
    if declared.kind == "pose":
        return validation.pose_numbers(field, _whole_pose(field, declared, value))
    if declared.kind == "rotation":
        return np.ravel(validation.rotation(field, value), order="F")
    if declared.joints is not None:
        value = _spread(robot, field, declared, value)
    if declared.kind == "configuration":
        return robot.configuration(field, value)
    count = declared.size if declared.kind == "vector" else size(robot, declared)
    bounded = declared.low > -math.inf or declared.high < math.inf
    plain = not (bounded or declared.direction)
    ready = type(value) is np.ndarray and value.dtype == np.float64 and value.shape == (count,) and plain and count > 0
    # The sum of the magnitudes is finite only if all numbers are
    if ready and math.isfinite(sum(map(abs, value.tolist()))):
        return np.asarray(value)
    if declared.direction and type(value) is np.ndarray and value.shape == (3,) and value.dtype == np.float64:
        length = math.hypot(*value.tolist())
        if ORDINARY < length < 1.0 / ORDINARY:
            return np.asarray(value / length)
    alone = not count or (declared.each and validation.dimensions(field, value) == ())
    given = validation.real_array(field, value, () if alone else (count,), finite=declared.infinite is None)
    numbers = np.full(max(count, 1), given) if alone else given
    if declared.infinite is not None and not (np.isfinite(numbers) | (numbers == declared.infinite)).all():
        raise NotFiniteError(field, value, f"expected finite numbers, or {declared.infinite:g} for no limit")
    if declared.direction:
        return validation.unit_vector(field, numbers)
    if bounded:
        for number in numbers[np.isfinite(numbers)]:
            validation.scalar(field, number, low=declared.low, high=declared.high, unit=declared.unit)
    return numbers


def _whole_pose(field: str, declared: Input, value: Any) -> Any:
    """A pose, where the part of it that counts is given; else what is given."""
    if not declared.part or is_pose(value) or (isinstance(value, (tuple, list)) and len(value) == 2):
        return value
    shape = validation.dimensions(field, value)
    if shape in ((7,), (4, 4)):
        return value
    if declared.part == "position":
        if shape != (3,):
            raise ShapeError(field, value, f"expected a position, 3 numbers, or a pose; is of shape {shape}")
        return own.SE3(np.eye(3), validation.real_array(field, value, (3,)))
    return own.SE3(validation.rotation(field, value), np.zeros(3))


def _spread(robot: Robot, field: str, declared: Input, value: Any) -> Any:
    """All numbers of a configuration or a velocity, where those of the chosen joints are given; else what is given."""
    numbers = validation.real_array(field, value)
    model, turns = robot.tree, declared.kind == "configuration"
    starts, counts = (model.idx_qs, model.nqs) if turns else (model.idx_vs, model.nvs)
    chosen = [int(model.getJointId(name)) for name in declared.joints or ()]
    at = [k for j in chosen for k in range(int(starts[j]), int(starts[j]) + int(counts[j]))]
    whole = size(robot, declared)
    if numbers.shape == (whole,):
        return value
    if numbers.shape != (len(at),):
        expected = f"expected {len(at)} numbers for {', '.join(declared.joints or ())}, or {whole} for all joints"
        raise ShapeError(field, value, f"{expected}, not shape {numbers.shape}")
    out = robot.neutral.copy() if turns else np.zeros(robot.nv)
    out[at] = numbers
    return out


@dataclass(frozen=True, eq=False)
class Symbols:
    """Symbols of some inputs: ``flat`` in buffer order, and ``values`` as an item's expressions receive them."""

    flat: dict[str, ca.SX]
    values: dict[str, ca.SX | Pose]

    @property
    def vector(self) -> ca.SX:
        """All numbers, input after input."""
        return ca.vertcat(ca.SX(0, 1), *self.flat.values())


def symbols(robot: Robot, declared: Sequence[Input]) -> Symbols:
    """Fresh symbols for the inputs."""
    numbers = {d.name: ca.SX.sym(d.name, size(robot, d)) for d in declared}
    return Symbols(numbers, {d.name: as_value(d, numbers[d.name]) for d in declared})


def as_value(declared: Input, numbers: ca.SX) -> ca.SX | Pose:
    """What an item's expression receives for an input with these numbers."""
    if declared.kind == "pose":
        return Pose(ca.reshape(numbers[:9], 3, 3), numbers[9:])
    return ca.reshape(numbers, 3, 3) if declared.kind == "rotation" else numbers


#: Names of the inputs of sensed rows
SENSED = ("distance", "drift", "line", "side")


def sensed(robot: Robot, count: int) -> tuple[Input, ...]:
    """The inputs of ``count`` sensed rows, see :meth:`wbc.tasks.base.Constraint.sensed_rows`."""
    return (
        Input("distance", unit="m", size=count, default=np.full(count, FAR), rate="drift", sensed=True),
        Input("drift", unit="m/s", size=count, default=np.zeros(count), sensed=True),
        Input("line", unit="1, m", size=6 * count, default=np.zeros(6 * count), sensed=True),
        Input("side", size=robot.nv * count, default=np.zeros(robot.nv * count), sensed=True),
    )


def check(robot: Robot, field: str, declared: Sequence[Input]) -> None:
    """Check the declarations of a user's own inputs.

    Raises:
        ShapeError, DuplicateNameError, UnknownNameError, RangeError, BoundsError: named by input.
    """
    names = [d.name for d in declared if isinstance(d, Input)]
    for d in declared:
        if not isinstance(d, Input):
            raise ShapeError(field, d, "expected an Input")
        if not isinstance(d.name, str) or not d.name.isidentifier():
            raise ShapeError(field, d.name, "the name of an input must be a Python identifier")
        if d.name in RESERVED:
            raise DuplicateNameError(field, d.name, "every item has an input of this name")
        if names.count(d.name) > 1:
            raise DuplicateNameError(field, d.name, "two inputs of this name")
        where = f"{field}.{d.name}"
        validation.one_of(f"{where}.kind", d.kind, get_args(Kind))
        if isinstance(d.size, bool) or not isinstance(d.size, int) or d.size < 0:
            raise RangeError(f"{where}.size", d.size, "expected an integer >= 0")
        for side in ("low", "high"):
            validation.real_array(f"{where}.{side}", getattr(d, side), (), finite=False)
        for switch in ("direction", "sensed"):
            validation.flag(f"{where}.{switch}", getattr(d, switch))
        for word in ("unit", "rate", "below"):
            if getattr(d, word) is not None:
                validation.instance(f"{where}.{word}", getattr(d, word), str, "a string")
        if d.infinite is not None and not math.isinf(
            float(validation.real_array(f"{where}.infinite", d.infinite, (), finite=False))
        ):
            raise RangeError(f"{where}.infinite", d.infinite, "expected inf or -inf, or None for finite numbers")
        if not d.low <= d.high:
            raise BoundsError(f"{where}.low", d.low, f"above high = {d.high!r}, or NaN")
        if d.default is not None:
            flat(robot, f"{where}.default", d, d.default)
        if d.below is not None:
            _check_order(robot, where, d, declared)
        if d.rate is not None:
            validation.one_of(f"{where}.rate", d.rate, names)
            other = declared[names.index(d.rate)]
            found, wanted = size(robot, other), rate_size(robot, d)
            if found != wanted or other.kind not in ("vector", "tangent"):
                reason = f"the rate of {d.name!r} has {wanted} numbers, the {other.kind} {d.rate!r} has {found}"
                raise ShapeError(f"{where}.rate", d.rate, reason)


def _check_order(robot: Robot, where: str, lower: Input, declared: Sequence[Input]) -> None:
    upper = next((d for d in declared if d.name == lower.below), None)
    if upper is None:
        raise UnknownNameError(f"{where}.below", lower.below, [d.name for d in declared])
    if (upper.kind, size(robot, upper)) != (lower.kind, size(robot, lower)):
        raise ShapeError(f"{where}.below", upper.name, "expected an input of the same kind and size")
    if lower.default is None or upper.default is None:
        raise ShapeError(f"{where}.below", upper.name, "both inputs need a default")
    low, high = (flat(robot, where, d, d.default) for d in (lower, upper))
    require_order(where, low, high, f"above {upper.name}")


def require_order(field: str, lower: Array, upper: Array, reason: str) -> None:
    """Refuse lower > upper in any entry.

    Raises:
        BoundsError: with the first such pair.
    """
    wrong = np.flatnonzero(lower > upper)
    if wrong.size:
        k = int(wrong[0])
        raise BoundsError(field, (float(lower[k]), float(upper[k])), f"entry {k}: {reason}")
