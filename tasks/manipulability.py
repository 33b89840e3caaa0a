"""A hand stays where it can move well: the measure of manipulability goes to a target."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar, Literal

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from wbc import validation
from wbc.errors import RangeError
from wbc.multibody import pin
from wbc.robot import Robot
from wbc.symbolic.kinematics import WORLD, frame_index
from wbc.symbolic.manipulability import FLOOR
from wbc.symbolic.tracer import Tracer
from wbc.tasks._selection import selection
from wbc.tasks.base import Input, Row, Task, Values
from wbc.tasks.frames import frame_pose

LABELS = ("x", "y", "z", "rx", "ry", "rz")
ROWS_OF_KIND = {"pose": LABELS, "position": LABELS[:3], "orientation": LABELS[3:]}
FORMS = ("linear", "log")

#: Configurations at which :meth:`Manipulability.validate` looks for one that is not singular
_TRIED = 8
#: Manipulability below this part of the largest counts as singular
_SINGULAR = 1e-6


@dataclass(frozen=True)
class Manipulability(Task):
    """How well a frame can be moved goes to a target:

        e = w - target                    form "linear"
        e = log(w / target)               form "log"                                         [1]
        w = sqrt(det(J J' + floor^2 I))   = prod_i sqrt(s_i^2 + floor^2),  floor = 1e-4

    J is the Jacobian of the frame as seen from ``relative_to``, its rows in metres divided by ``length``, and s_i are
    its singular values: w is Yoshikawa's measure (1985) as a pure number. An arm of a metre has w of some 0.1 for
    positions, 2 to 3 for orientations and 0.05 for poses; ``value(robot, q)`` gives it. Only the joints between
    ``relative_to`` and the frame count: measure an arm from the body that it is mounted on.

    Both forms have the same maxima; the log form is slow next to a singular configuration. A target beyond reach
    drives w to a maximum, where it rests. To keep w above a bound use ``Limit(task, lower=...)`` with the task's
    target at 1e-4 to the number of rows.

    Attributes:
        frame: frame of the hand.
        kind: ``pose`` (6 rows of J), ``position`` (3) or ``orientation`` (3).
        along: rows of J that count instead, by their labels out of x, y, z, rx, ry, rz in the axes of ``relative_to``:
            ("x", "y") for a planar arm.
        relative_to: frame that the motion is seen from; ``"world"`` or a frame of the robot.
        form: ``linear`` or ``log``.
        length: what rows in metres are divided by [m]; None: ``robot.characteristic_length``.

    Inputs:
        target: what w shall be, > 0; a target above what the arm can reach drives w to a maximum. Default: the present
            w, see :meth:`value`.
        feedforward: its rate [1/s]. Default 0.

    What it cannot do: find the best configuration: it climbs w, which has several maxima. In a singular configuration
    the gradient is zero. Joint limits do not count. An arm that is singular everywhere is refused; choose rows with
    ``along``.

    Example:
        >>> import wbc
        >>> robot = wbc.robots.load("panda", shapes="none")
        >>> agile = wbc.tasks.Manipulability("panda_hand_tcp", kind="position")
        >>> stack = wbc.Stack(robot, dt=0.005)
        >>> stack.add(wbc.tasks.EndEffector("panda_hand_tcp"), name="hand")
        >>> stack.add(agile, name="agile", weight=1e-3)
        >>> stack.add(wbc.tasks.Posture(), name="posture", weight=1e-5)
        >>> controller = stack.compile(backend="vm")
        >>> step = controller.step(robot.neutral)
        >>> controller["agile"].target = 2 * agile.value(robot, robot.neutral)

    Raises:
        UnknownNameError, DuplicateNameError, ShapeError, NotFiniteError: on construction or in :meth:`validate`.
        RangeError: w is zero wherever the arm is, or length <= 0.
    """

    frame_fields: ClassVar[tuple[str, ...]] = ("frame", "relative_to")

    stands_in_world: ClassVar[bool] = False

    frame: str
    kind: Literal["pose", "position", "orientation"] = "pose"
    along: tuple[str, ...] | None = None
    relative_to: str = WORLD
    form: Literal["linear", "log"] = "linear"
    length: float | None = None

    def __post_init__(self) -> None:
        validation.one_of("Manipulability.kind", self.kind, ROWS_OF_KIND)
        validation.one_of("Manipulability.form", self.form, FORMS)
        if self.along is not None:
            labels = selection("Manipulability.along", self.along)
            for label in labels:
                validation.one_of("Manipulability.along", label, LABELS)
            object.__setattr__(self, "along", tuple(sorted(labels, key=LABELS.index)))
        if self.length is not None:
            validation.own_scalars(self, "length", low=0.0, open_low=True, unit="m")

    def validate(self, robot: Robot) -> None:
        super().validate(robot)
        rng = np.random.default_rng(0)
        drawn = (pin.integrate(robot.model, robot.neutral, rng.uniform(-2.0, 2.0, robot.nv)) for _ in range(_TRIED))
        if all(self._singular_values(robot, q)[-1] < _SINGULAR for q in drawn):
            rows = ", ".join(LABELS[k] for k in self._rows)
            reason = f"no joints move this frame in all of {rows}; choose fewer with along="
            raise RangeError("Manipulability.frame", self.frame, reason)

    def inputs(self, robot: Robot) -> tuple[Input, ...]:
        least = FLOOR ** len(self._rows)
        return (Input("target", low=least, rate="feedforward"), Input("feedforward", unit="1/s", default=0.0))

    def rows(self, robot: Robot) -> tuple[Row, ...]:
        return (Row("w", "1"),)

    def initial(self, robot: Robot, q: NDArray[np.float64]) -> dict[str, Any]:
        return {"target": self.value(robot, q)}

    def value(self, robot: Robot, q: NDArray[np.float64]) -> float:
        """w at a configuration, by numpy."""
        return float(np.prod(np.sqrt(self._singular_values(robot, q) ** 2 + FLOOR**2)))

    def error(self, robot: Robot, kin: Tracer, inputs: Values) -> ca.SX:
        w = kin.manipulability(self.frame, self.relative_to, self._rows, self._length(robot))
        error: ca.SX = ca.log(w / inputs["target"]) if self.form == "log" else w - inputs["target"]
        return error

    @property
    def _rows(self) -> tuple[int, ...]:
        return tuple(LABELS.index(label) for label in self.along or ROWS_OF_KIND[self.kind])

    def _length(self, robot: Robot) -> float:
        return robot.characteristic_length if self.length is None else self.length

    def _singular_values(self, robot: Robot, q: NDArray[np.float64]) -> NDArray[np.float64]:
        """Of the chosen rows of J, by Pinocchio; the largest first."""
        data = robot.model.createData()
        pin.computeJointJacobians(robot.model, data, q)
        pin.updateFramePlacements(robot.model, data)
        base = frame_pose(robot, self.relative_to, q)
        arm = frame_pose(robot, self.frame, q).translation - base.translation
        own, carrier = (_jacobian(robot, data, frame) for frame in (self.frame, self.relative_to))
        linear = base.rotation.T @ (own[:3] - carrier[:3] + pin.skew(arm) @ carrier[3:])
        angular = base.rotation.T @ (own[3:] - carrier[3:])
        chosen = np.vstack([linear / self._length(robot), angular])[list(self._rows)]
        values = np.zeros(len(self._rows))
        found = np.linalg.svd(chosen, compute_uv=False)
        values[: found.size] = found
        return values


def _jacobian(robot: Robot, data: pin.Data, frame: str) -> NDArray[np.float64]:
    if frame == WORLD:
        return np.zeros((6, robot.nv))
    number = frame_index(robot.model, frame)
    return np.array(pin.getFrameJacobian(robot.model, data, number, pin.LOCAL_WORLD_ALIGNED))
