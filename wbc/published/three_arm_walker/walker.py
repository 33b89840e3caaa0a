"""The published walker as users meet it, in SI units: one object, three modes."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import Any, Literal

import numpy as np

from wbc import validation
from wbc.errors import RangeError, ShapeError
from wbc.published.three_arm_walker.gait.gait import Gait
from wbc.published.three_arm_walker.literal import LiteralPlant
from wbc.published.three_arm_walker.machine.calibration import Variant, WalkerCalibration
from wbc.published.three_arm_walker.machine.grid import (
    COLUMNS,
    INCH,
    PITCH,
    RADIUS,
    ROWS,
    STEP,
    Terrain,
    checked_place,
    frame,
)
from wbc.published.three_arm_walker.machine.motion import CYCLE
from wbc.published.three_arm_walker.machine.plant import IdealPlant, WalkerPose, moved
from wbc.published.three_arm_walker.machine.reach import ARMS, Shoulders
from wbc.published.three_arm_walker.modes import (
    ArmMotion,
    DestinationCommand,
    at_velocity,
    joystick,
    past_poses,
    to_handhold,
)
from wbc.published.three_arm_walker.record import PublishedLog
from wbc.published.three_arm_walker.supervisor import PublishedOutcome, Supervisor
from wbc.validation import Array

#: A value, or one for each time of the mode [s]
Given = Any


class PublishedWalker:
    """Three PUMA 600 arms on a triangle, walking on the holds of a cylinder as the thesis has it; cycles of 0.1 s.

    ``tracking="ideal"`` has hands exactly where they are to be and looks only at the reach of the wrists;
    ``"rates"`` integrates the joint rates of SOLVE and checks all joint limits, and does not get far.

    Args:
        place: (T, A) over which the body starts. heading: about the inward normal, 0 along +A [rad].
        height: of the body's origin above the cylinder, which it keeps [m].
        threshold: of the margins below which an arm may step [grid units of 0.235 m].
        removed: places (T, A) without a hold.
        calibration: what the thesis does not print.
        margin, singular: where listing and text disagree: the limits of margins, the joint that turns a straight wrist.
        offset: added to the height at the start, not kept [m]. tilt: at the start, about the body's x and y axes [rad].

    Attributes:
        supervisor: the walker in inches.

    Raises:
        ShapeError, NotFiniteError, RangeError, UnknownNameError: what does not describe a walker.
    """

    def __init__(
        self,
        place: Sequence[float] = (13.0, 12.0),
        heading: float = 0.0,
        *,
        height: float = 52.0 * INCH,
        threshold: float = 1.0,
        removed: Iterable[Any] = (),
        calibration: WalkerCalibration | None = None,
        tracking: Literal["ideal", "rates"] = "ideal",
        margin: Variant = "listing",
        singular: Variant = "listing",
        offset: float = 0.0,
        tilt: Sequence[float] = (0.0, 0.0),
    ) -> None:
        column, row = _point("place", place)
        heading = validation.scalar("heading", heading, unit="rad")
        height = validation.scalar("height", height, low=0.0, unit="m")
        threshold = validation.scalar("threshold", threshold)
        offset = validation.scalar("offset", offset, low=-height, unit="m")
        tilts = validation.real_array("tilt", tilt, (2,))
        for field, value in (("margin", margin), ("singular", singular)):
            validation.one_of(field, value, ("listing", "text"))
        validation.one_of("tracking", tracking, ("ideal", "rates"))
        known = calibration or WalkerCalibration()
        shoulders = _shoulders(known.shoulder_radius / INCH, height / INCH)
        body = frame(column, row, RADIUS + (height + offset) / INCH, heading)
        turn = body[:3, :3] @ np.array([*tilts, 0.0])
        body = moved(body, np.concatenate([np.zeros(3), turn / CYCLE]))
        plant: WalkerPose = IdealPlant(shoulders, body)
        if tracking == "rates":
            plant = LiteralPlant(shoulders, body, known, singular)
        self.supervisor = Supervisor(Gait(shoulders, Terrain(removed), known, threshold, margin), plant)

    @property
    def place(self) -> tuple[float, float, float]:
        """(T, A, heading [rad]) of the body."""
        column, row, heading = self.supervisor.place.tolist()
        return column, row, heading

    @property
    def log(self) -> PublishedLog:
        """Everything since the start, the setting down of arms included."""
        return self.supervisor.recorder.log()

    def to(self, points: Sequence[Sequence[float]], key: Callable[[float], bool] | None = None) -> PublishedOutcome:
        """Robot destination control: past places (T, A, heading [rad]), at most 0.059 m/s along and 1 degree/s.

        Args:
            key: called in every cycle with the time of the mode [s]; true ends it.

        Raises:
            ShapeError, NotFiniteError, RangeError: what is no place above the grid.
        """
        numbers = validation.real_array("points", points)
        if numbers.ndim != 2 or numbers.shape[1] != 3 or not len(numbers):
            raise ShapeError("points", points, "expected rows of T, A, heading")
        for k, point in enumerate(numbers):
            _point(f"points[{k}]", point[:2])
        return self.supervisor.walk(DestinationCommand(numbers.tolist()), _pressed(key))

    def drive(
        self, velocity: Given, duration: float | None = None, key: Callable[[float], bool] | None = None
    ) -> PublishedOutcome:
        """Robot velocity control, until a key or for a duration [s].

        Args:
            velocity: round the structure (+T) and along it (+A) at the body [m/s], spin [rad/s]; or a function of the
                time of the mode [s].
        """
        scale = np.array([STEP * (RADIUS + self.supervisor.gait.shoulders.height) * INCH, PITCH * INCH, 1.0])
        given = _function("velocity", velocity, 3)
        return self.supervisor.walk(lambda time, _: given(time) / scale, _pressed(key), _ending(duration, key))

    def joystick(
        self, counts: Given, duration: float | None = None, key: Callable[[float], bool] | None = None
    ) -> PublishedOutcome:
        """Robot velocity control by three axes of -32768 to 32767 counts: T, A, spin."""
        given = _function("counts", counts, 3)
        return self.supervisor.walk(
            lambda time, _: joystick(given(time).tolist()), _pressed(key), _ending(duration, key)
        )

    def handhold(self, arm: int, place: Sequence[int], key: Callable[[float], bool] | None = None) -> PublishedOutcome:
        """Arm control: an arm, 1 to 3, goes to a hold and grasps, the body standing.

        Raises:
            RangeError: no such arm or place, or a place without a hold.
        """
        wanted = checked_place("place", place)
        if not self.supervisor.gait.terrain.has(wanted):
            raise RangeError("place", place, "there is no hold")
        return self._arm(to_handhold(*self._moved, _arm(arm), wanted), key)

    def hand_to(self, arm: int, poses: Sequence[Any], key: Callable[[float], bool] | None = None) -> PublishedOutcome:
        """Arm control: the hand of an arm, 1 to 3, past poses in the frame of the structure [m], the body standing.

        Raises:
            ShapeError, NotFiniteError, RotationError, RangeError: no arm, or what is no pose.
        """
        number = _arm(arm)
        if not len(poses):
            raise ShapeError("poses", poses, "expected at least one pose")
        checked = [validation.pose(f"poses[{k}]", pose).homogeneous for k, pose in enumerate(poses)]
        for pose in checked:
            pose[:3, 3] /= INCH
        return self._arm(past_poses(*self._moved, number, checked), key)

    def hand_at(
        self, arm: int, twist: Given, duration: float | None = None, key: Callable[[float], bool] | None = None
    ) -> PublishedOutcome:
        """Arm control: the hand of an arm, 1 to 3, at a twist in the axes of the structure, the body standing.

        Args:
            twist: linear, angular [m/s, rad/s], or a function of the time of the mode [s].
        """
        given = _function("twist", twist, 6)
        scale = np.repeat([1.0 / INCH, 1.0], 3)
        motion = at_velocity(*self._moved, _arm(arm), lambda time: given(time) * scale)
        return self._arm(motion, key, _ending(duration, key))

    @property
    def _moved(self) -> tuple[Gait, WalkerPose]:
        return self.supervisor.gait, self.supervisor.plant

    def _arm(self, task: ArmMotion, key: Callable[[float], bool] | None, duration: float = np.inf) -> PublishedOutcome:
        return self.supervisor.control_arm(task, _pressed(key), duration)


def _point(field: str, value: Any) -> tuple[float, float]:
    column, row = validation.real_array(field, value, (2,))
    validation.scalar(f"{field}[0]", column, low=1.0, high=COLUMNS)
    validation.scalar(f"{field}[1]", row, low=1.0, high=ROWS)
    return float(column), float(row)


def _shoulders(radius: float, height: float) -> Shoulders:
    """Shoulders whose arms reach the structure."""
    out = Shoulders(radius, height)
    if out.reach <= 0.0:
        raise RangeError("height", height, "no hold is within reach [in]")
    return out


def _arm(value: Any) -> int:
    number = validation.real_array("arm", value, ())
    if number not in range(1, ARMS + 1):
        raise RangeError("arm", value, f"expected a whole number in [1, {ARMS}]")
    return int(number) - 1


def _function(field: str, value: Given, size: int) -> Callable[[float], Array]:
    """Checked numbers of each time."""
    if callable(value):
        return lambda time: validation.real_array(field, value(time), (size,))
    fixed = validation.real_array(field, value, (size,))
    return lambda time: fixed


def _pressed(key: Callable[[float], bool] | None) -> Callable[[float, Array], bool]:
    return lambda time, place: key is not None and bool(key(time))


def _ending(duration: float | None, key: Callable[[float], bool] | None) -> float:
    """The duration of a mode that does not end by itself."""
    if duration is None and key is None:
        raise RangeError("duration", duration, "give a duration or a key, this mode does not end by itself")
    return np.inf if duration is None else validation.scalar("duration", duration, low=0.0, unit="s")
