"""Joints that move in a fixed linear relation: equal, opposite, or in a gear's ratio."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from wbc import validation
from wbc.errors import RangeError, ShapeError
from wbc.robot import Robot
from wbc.symbolic.tracer import Tracer
from wbc.tasks.base import Input, Row, Task, Values
from wbc.tasks.frames import checked_weights

#: One row: (joint, coefficient) pairs.
Relation = tuple[tuple[str, float], ...]


@dataclass(frozen=True)
class JointCoupling(Task):
    """A weighted sum of joint coordinates, one sum a row, goes to a target:

        e_k = sum_i c_ki q_i - target_k                                    [rad, or m for rows of sliding joints]

    An unbounded joint is known up to whole turns, so a row that has one is the angle in (-pi, pi] that equals e_k up
    to whole turns, and its unbounded joints must have whole coefficients: write 2 a - 3 b for a gear of 2/3. Bounded
    joints in such a row may have any coefficient.

    A row has the unit of its first joint, and its label is the relation: ``2 wheel - 3 motor``. Coefficients carry the
    unit that the others lack: 0.005 m/rad of a screw.

    Attributes:
        coefficients: joint name -> coefficient, or a sequence of such, one a row.
        target: first value of the input: one number for all rows or one a row; None: its sum at the first step.
        weights: one number >= 0 a row, None: 1 each.

    Inputs:
        target: one number a row. Default: ``target`` of the constructor, 0 where nothing is said; ``target=None``:
            where the sum is at the first step.
        feedforward: its rate. Default 0.

    What it cannot do: hold exactly: it is a task with a weight (``Mechanism`` holds what the mechanism couples). Turns
    are not counted: of several positions that satisfy a gear the nearest is taken. Joints of several degrees of freedom
    are refused.

    Example:
        >>> import wbc
        >>> robot = wbc.robots.load("talos", shapes="none")
        >>> stack = wbc.Stack(robot, dt=0.002)
        >>> stack.add(wbc.tasks.JointCoupling({"arm_left_4_joint": 1, "arm_right_4_joint": -1}), name="elbows")
        >>> controller = stack.compile(backend="vm")
        >>> controller["elbows"].target = [0.1]

    Raises:
        ShapeError, NotFiniteError, UnknownNameError: no relation, a joint that does not exist or has several degrees of
            freedom.
        RangeError: a row without a coefficient other than 0, an uneven coefficient of an unbounded joint.
    """

    stands_in_world: ClassVar[bool] = False

    initial_only: ClassVar[tuple[str, ...]] = ("gain", "target")

    coefficients: tuple[Relation, ...]
    target: float | tuple[float, ...] | None = 0.0
    weights: tuple[float, ...] | None = None

    def __init__(
        self,
        coefficients: Mapping[str, float] | Sequence[Mapping[str, float]],
        target: float | Sequence[float] | None = 0.0,
        weights: Sequence[float] | None = None,
        *,
        gain: float | None = None,
    ) -> None:
        given = [coefficients] if isinstance(coefficients, Mapping) else coefficients
        if not isinstance(given, (list, tuple)) or not given:
            raise ShapeError("JointCoupling.coefficients", coefficients, "expected {joint: coefficient}, or several")
        labels = [""] if isinstance(coefficients, Mapping) else [f"[{k}]" for k in range(len(given))]
        relations = tuple(_relation(f"JointCoupling.coefficients{k}", r) for k, r in zip(labels, given, strict=True))
        object.__setattr__(self, "coefficients", relations)
        object.__setattr__(self, "target", _targets(target, len(relations)))
        object.__setattr__(self, "weights", checked_weights("JointCoupling.weights", weights, len(relations)))
        object.__setattr__(self, "gain", gain)

    def validate(self, robot: Robot) -> None:
        single = [j for j in robot.joint_names if _width(robot, j) == 1]
        for k, relation in enumerate(self.coefficients):
            for joint, coefficient in relation:
                field = f"JointCoupling.coefficients[{k}]"
                validation.one_of(field, joint, single)
                if _unbounded(robot, joint) and coefficient != round(coefficient):
                    reason = f"unbounded joint {joint!r} is known up to whole turns: its coefficient must be whole"
                    raise RangeError(field, coefficient, reason)

    def inputs(self, robot: Robot) -> tuple[Input, ...]:
        count, units = len(self.coefficients), ", ".join(dict.fromkeys(row.unit for row in self.rows(robot)))
        rates = ", ".join(f"{unit}/s" for unit in units.split(", "))
        return (
            Input("target", unit=units, size=count, default=self.target, rate="feedforward", each=True),
            Input("feedforward", unit=rates, size=count, default=np.zeros(count), each=True),
        )

    def rows(self, robot: Robot) -> tuple[Row, ...]:
        names = [_label(relation) for relation in self.coefficients]
        repeated = [f" ({k})" if names.count(name) > 1 else "" for k, name in enumerate(names)]
        units = [robot.dof_units[robot.dofs(relation[0][0]).start] for relation in self.coefficients]
        return tuple(Row(name + more, unit) for name, more, unit in zip(names, repeated, units, strict=True))

    def initial(self, robot: Robot, q: NDArray[np.float64]) -> dict[str, Any]:
        sums = [sum(c * _coordinate(robot, joint, q) for joint, c in relation) for relation in self.coefficients]
        return {"target": np.array(sums)}

    def error(self, robot: Robot, kin: Tracer, inputs: Values) -> ca.SX:
        errors: list[ca.SX] = []
        for k, relation in enumerate(self.coefficients):
            total = sum((c * kin.joint(joint) for joint, c in relation), ca.SX(0)) - inputs["target"][k]
            turning = any(_unbounded(robot, joint) for joint, _ in relation)
            errors.append(ca.atan2(ca.sin(total), ca.cos(total)) if turning else total)
        return ca.vertcat(*errors)


def _relation(field: str, given: Any) -> Relation:
    if isinstance(given, tuple) and all(isinstance(pair, tuple) and len(pair) == 2 for pair in given):
        given = dict(given)  # as the field itself holds it, so that dataclasses.replace works
    if not isinstance(given, Mapping) or not all(isinstance(joint, str) for joint in given):
        raise ShapeError(field, given, "expected {joint: coefficient}")
    numbers = [(joint, validation.scalar(f"{field}[{joint!r}]", c)) for joint, c in given.items()]
    relation = tuple((joint, c) for joint, c in numbers if c != 0.0)
    if not relation:
        raise RangeError(field, given, "expected a coefficient other than 0")
    return relation


def _targets(given: Any, count: int) -> tuple[float, ...] | None:
    if given is None:
        return None
    numbers = validation.real_array("JointCoupling.target", given)
    if numbers.shape not in ((), (count,)):
        raise ShapeError("JointCoupling.target", given, f"expected one number or {count}")
    return tuple(float(x) for x in np.broadcast_to(numbers, count))


def _label(relation: Relation) -> str:
    text = ""
    for joint, c in relation:
        sign = ("- " if text else "-") if c < 0 else ("+ " if text else "")
        size = "" if abs(c) == 1.0 else f"{abs(c):g} "
        text += f"{' ' if text else ''}{sign}{size}{joint}"
    return text


def _width(robot: Robot, joint: str) -> int:
    return int(robot.tree.nvs[robot.tree.getJointId(joint)])


def _unbounded(robot: Robot, joint: str) -> bool:
    return int(robot.tree.nqs[robot.tree.getJointId(joint)]) == 2


def _coordinate(robot: Robot, joint: str, q: NDArray[np.float64]) -> float:
    start = int(robot.tree.idx_qs[robot.tree.getJointId(joint)])
    return float(np.arctan2(q[start + 1], q[start]) if _unbounded(robot, joint) else q[start])
