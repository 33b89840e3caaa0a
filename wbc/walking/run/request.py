"""What a run is asked to do: on what, from where to where, how fast; as a user types it."""

from __future__ import annotations

import pathlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from math import radians

import numpy as np
import pinocchio as pin

from wbc import validation
from wbc.errors import RangeError, ShapeError
from wbc.robots import WalkerData
from wbc.validation import Array
from wbc.walking.body_path import BodyPath, grid_path, straight_path
from wbc.walking.holds.built_in import BUILT_IN, ROWS_A, ROWS_T, remove_columns, remove_fraction, remove_rows
from wbc.walking.holds.files import read_structure
from wbc.walking.holds.structure import Structure
from wbc.walking.two_ended import grapple_row
from wbc.walking.two_ended.search import GAITS

MODES = ("destination", "velocity", "arm")
PLANNERS = ("free", "published")
ROBOTS = ("three-armed", "two-ended")
#: A row of holds for the two-ended arm
GRAPPLES = "grapples"
#: Where a walk begins and ends on a built-in structure when nothing is said
ENDS = {
    "cylinder": ("13,6", "13,18"),
    "plane": ("8,6", "8,17"),
    "truss": ("L2,6", "L2,18"),
    "module": ("15,4", "15,14"),
    "grapples": ("1 2", "6"),
}
#: 4 in/s
SPEED = 0.1016


@dataclass(frozen=True)
class WalkRequest:
    """A walk as it is asked for.

    Attributes:
        structure: ``cylinder``, ``plane``, ``truss``, ``module``, ``grapples`` or a structure file.
        mode: ``velocity``: at the speed, fewest delays first; ``destination``: fewest re-grasps first.
        speed: of the body's origin in the structure's frame [m/s]. turn_rate: largest [rad/s].
        start, points: places that the body is over at the beginning and then. On the cylinder ``T,A`` or
            ``T,A,heading`` [deg], fractions allowed; else ids of holds, x of the body along the way. Empty:
            :data:`ENDS`.
        rows, columns: holds "T,A" that are taken away, such as ``12-14``, by A and by T.
        fraction, seed: part of the holds that is taken away at random.
        planner: ``free`` or ``published``.
        rigid: holds fix the tilt of a hand.
        commands: a file of rates, or ``keyboard``, which drive the body in velocity mode instead of a path; "": none.
        arm, tasks: of arm mode: its name, and what it does, see :mod:`wbc.walking.run.arm_run`.
        free_start: nothing is held at the beginning, and the body is declared fixed until enough hands hold.
        robot: ``three-armed`` or ``two-ended``. The latter goes from two holds, ``ID1 ID2``, to a hold or a place
            ``x,y,z`` [m], in destination mode.
        gait: of the two-ended arm: ``any``, ``inchworm`` or ``turnaround``.
        plan: a file of a plan, which is carried out as it is along its own way; "": plan.
    """

    structure: str = "cylinder"
    mode: str = "velocity"
    speed: float = SPEED
    turn_rate: float = 0.05
    start: str = ""
    points: tuple[str, ...] = ()
    rows: str = ""
    columns: str = ""
    fraction: float = 0.0
    seed: int = 0
    planner: str = "free"
    rigid: bool = False
    commands: str = ""
    arm: str = ""
    tasks: tuple[str, ...] = ()
    free_start: bool = False
    robot: str = "three-armed"
    gait: str = "any"
    plan: str = ""

    def __post_init__(self) -> None:
        validation.one_of("mode", self.mode, MODES)
        validation.one_of("planner", self.planner, PLANNERS)
        for name in ("speed", "turn_rate"):
            validation.scalar(name, getattr(self, name), low=0.0, open_low=True)
        if self.commands and self.mode != "velocity":
            raise RangeError("commands", self.commands, "they are for the mode 'velocity'")
        if (self.mode == "arm") != bool(self.tasks):
            raise RangeError("do", self.tasks, "say what the hand is to do in the mode 'arm', and in no other")
        if self.planner == "published" and (self.commands or self.tasks or self.free_start):
            raise RangeError("planner", self.planner, "commands, arm mode and a free start are of the planner 'free'")
        validation.one_of("robot", self.robot, ROBOTS)
        validation.one_of("gait", self.gait, tuple(GAITS))
        two_ended = self.robot == "two-ended"
        if self.plan and (two_ended or self.commands or self.tasks or self.free_start or self.planner == "published"):
            raise RangeError("plan", self.plan, "plans of files are of three arms that hold, and of the planner 'free'")
        if two_ended and (self.commands or self.tasks or self.free_start or self.planner == "published"):
            raise RangeError("robot", self.robot, "the two-ended arm goes to a hold or a place, by the planner 'free'")
        if self.gait != "any" and not two_ended:
            raise RangeError("gait", self.gait, "gaits are of the robot 'two-ended'")
        if self.planner == "published" and self.structure != "cylinder":
            raise RangeError("planner", self.planner, "the published planner knows only the structure 'cylinder'")

    def build(self) -> Structure:
        """The structure less the holds that are taken away.

        Raises:
            UnknownNameError: no such structure. StructureFileError: a bad file. RangeError, ShapeError: holds that are
                not there, or none left.
        """
        whole = self._whole()
        if self.rows:
            whole = remove_rows(whole, self.rows)
        if self.columns:
            whole = remove_columns(whole, self.columns)
        return remove_fraction(whole, self.fraction, self.seed)

    def places(self) -> tuple[str, ...]:
        """Where the body passes, the start first.

        Raises:
            ShapeError: a structure file, and not both ends given.
        """
        first, last = ENDS.get(self.structure, ("", ""))
        out = (self.start or first, *(self.points or (last,)))
        if not all(out):
            raise ShapeError("to", self.points, "say from which to which hold; a file has no ends of its own")
        return out

    def path(self, structure: Structure, data: WalkerData) -> BodyPath:
        """Where the body goes: over the grid of the cylinder, else from over hold to over hold.

        Raises:
            ShapeError, RangeError, UnknownNameError: places that are not there.
        """
        places = self.places()
        if self.structure == "cylinder":
            points = [grid_point(f"place {k + 1}", text) for k, text in enumerate(places)]
            return grid_path(points, self.speed, self.turn_rate, data.body_height)
        # Holds that were taken away still are places to be over
        return straight_path(over_holds(self._whole(), places, data.body_height), self.speed, self.turn_rate)

    def beginning(self, structure: Structure, data: WalkerData) -> pin.SE3:
        """Where the body is at first; where it is to go does not count.

        Raises:
            as :meth:`path`.
        """
        if self.structure in ENDS or self.points:
            return pin.SE3(self.path(structure, data).poses[0])
        return pin.SE3(replace(self, points=(self.start,)).path(structure, data).poses[0])

    def _whole(self) -> Structure:
        if self.structure == GRAPPLES:
            if self.rigid:
                raise RangeError("rigid", self.rigid, "these holds fix the tilt of a hand anyway")
            return grapple_row()
        if self.structure in BUILT_IN:
            make: Callable[..., Structure] = BUILT_IN[self.structure]  # type: ignore[assignment]
            return make(max_tilt=0.0) if self.rigid else make()
        if self.rigid:
            raise RangeError("rigid", self.rigid, "a file says itself what its holds allow")
        if "/" in self.structure or self.structure.lower().endswith(".csv") or pathlib.Path(self.structure).is_file():
            return read_structure(self.structure)
        validation.one_of("structure", self.structure, (*BUILT_IN, GRAPPLES, "FILE.csv"))
        raise RangeError("structure", self.structure, "no such file")


def grid_point(field: str, text: str) -> tuple[float, float, float]:
    """(T, A, heading [rad]) from ``T,A`` or ``T,A,heading`` with the heading in degrees.

    Raises:
        ShapeError: something else. RangeError: a place beside the grid.
    """
    try:
        numbers = [float(part) for part in text.split(",")]
    except ValueError as error:
        raise ShapeError(field, text, "expected T,A or T,A,heading [deg]") from error
    if len(numbers) not in (2, 3):
        raise ShapeError(field, text, "expected T,A or T,A,heading [deg]")
    t, a, heading = (*numbers, 0.0)[:3]
    validation.scalar(f"{field}.T", t, low=1.0, high=float(ROWS_T))
    validation.scalar(f"{field}.A", a, low=1.0, high=float(ROWS_A))
    return t, a, radians(validation.scalar(f"{field}.heading", heading, unit="deg"))


def over_holds(structure: Structure, names: Sequence[str], height: float) -> list[pin.SE3]:
    """Body poses at ``height`` [m] over holds: z along the approach direction, x along the way to the next one.

    From hold to hold the body turns by the smallest rotation that takes one approach direction to the other.

    Raises:
        UnknownNameError: no such hold.
    """
    rows = [structure.index(name) for name in names]
    axes = structure.axes[rows]
    places = structure.positions[rows] - height * axes
    ahead = next((p - places[0] for p in places[1:] if np.linalg.norm(p - places[0]) > 1e-6), None)
    turn = _frame(axes[0], structure.references[rows[0]] if ahead is None else ahead)
    out = []
    for k, place in enumerate(places):
        if k:
            turn = pin.Quaternion.FromTwoVectors(axes[k - 1], axes[k]).toRotationMatrix() @ turn
        out.append(pin.SE3(turn, place))
    return out


def _frame(z: Array, towards: Array) -> Array:
    """A rotation with this z axis and an x axis that is nearest to a direction; any x if that is along z."""
    across = towards - (towards @ z) * z
    if np.linalg.norm(across) < 1e-6:
        across = np.cross(z, np.eye(3)[int(np.argmin(np.abs(z)))])
    x = across / np.linalg.norm(across)
    return np.stack([x, np.cross(z, x), z], axis=1)
