"""Frames that joints move, out of a ``pin.Model``."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from enum import IntEnum
from functools import cached_property

import numpy as np

from wbc import validation
from wbc.errors import DuplicateNameError, UnsupportedJointError
from wbc.multibody import pin
from wbc.symbolic.joint_steps import JointKind, joint_steps, place, turns_for_quaternions
from wbc.validation import Array

SUPPORTED = ("revolute", "continuous", "prismatic", "helical", "universal", "free flyer", "fixed")


class Moves(IntEnum):
    """What a frame does on its parent; the same numbers stand in ``native/sweep.h``."""

    FIXED = 0
    TURNING = 1
    SHIFTING = 2
    FREE = 3


#: What a frame does that a scalar moves
SCALAR = (Moves.TURNING, Moves.SHIFTING)


@dataclass(frozen=True, eq=False)
class Frame:
    """A frame: at ``place`` on its parent, then moved.

    Attributes:
        parent: number of a frame before this one; -1: the world.
        coordinate: number of the scalar (a turn [rad] or shift [m] by scale q + offset) or of the free pose.
    """

    parent: int
    place: pin.SE3
    moves: Moves
    coordinate: int = 0
    axis: tuple[float, float, float] = (0.0, 0.0, 1.0)
    scale: float = 1.0
    offset: float = 0.0


@dataclass(frozen=True, eq=False)
class Tree:
    """Frames, parents first.

    Attributes:
        frames: of all joints.
        coordinates: names of the joints whose scalars a motion has, in its order.
        free: names of the joints with a free pose.
        links: name -> (number of its frame, pose of the link on it); "world" is on -1.
    """

    frames: tuple[Frame, ...] = field(repr=False)
    coordinates: tuple[str, ...]
    free: tuple[str, ...]
    links: dict[str, tuple[int, pin.SE3]] = field(repr=False)

    @classmethod
    def of_model(
        cls,
        model: pin.Model,
        floating: bool = False,
        things: Sequence[str] = (),
        orders: Mapping[int, tuple[int, int, int]] | None = None,
    ) -> Tree:
        """The joints of a model; of a joint without end its angle is the scalar.

        Args:
            floating: the model has a base that is fixed, and that a free pose carries here.
            things: what moves beside the model, each a link with a free pose; in a motion they come last.
            orders: of ball joints, and of free flyers, which then have three shifts and three turns in place of a free
                pose: axes of the turns, by the place of the joint's quaternion in q.

        Raises:
            DuplicateNameError: a thing that is called as a link or as another thing.
            UnsupportedJointError: a joint that is neither free nor a row of turns and shifts by scalars.
        """
        frames: list[Frame] = []
        names, free = list[str](), list[str]()
        scalar_of: dict[int, int] = {}
        top = -1
        if floating:
            frames.append(Frame(-1, pin.SE3.Identity(), Moves.FREE, 0))
            free.append("base")
            top = 0
        last = {0: top}
        for joint in range(1, model.njoints):
            name, parent = str(model.names[joint]), last[int(model.parents[joint])]
            at = pin.SE3(model.jointPlacements[joint])
            if orders is None and model.joints[joint].shortname() == "JointModelFreeFlyer":
                frames.append(Frame(parent, at, Moves.FREE, len(free)))
                free.append(name)
                last[joint] = len(frames) - 1
                continue
            for step in turns_for_quaternions(joint_steps(model, joint), orders or {}):
                if step.kind == JointKind.PLACE:
                    at = at * pin.SE3(step.numbers[:9].reshape(3, 3), step.numbers[9:])
                    continue
                if step.kind == JointKind.QUATERNION:
                    raise UnsupportedJointError(
                        f"joint {name!r}", model.joints[joint].shortname(), "a swept tree has", SUPPORTED
                    )
                if step.q not in scalar_of:
                    scalar_of[step.q] = len(names)
                    names.append(name)
                moves = Moves.SHIFTING if step.kind == JointKind.SHIFT else Moves.TURNING
                scale, offset = (1.0, 0.0) if step.kind == JointKind.CIRCLE else (step.numbers[3], step.numbers[4])
                axis = (float(step.numbers[0]), float(step.numbers[1]), float(step.numbers[2]))
                frames.append(Frame(parent, at, moves, scalar_of[step.q], axis, float(scale), float(offset)))
                parent, at = len(frames) - 1, pin.SE3.Identity()
            if parent == last[int(model.parents[joint])]:
                frames.append(Frame(parent, at, Moves.FIXED))
                parent = len(frames) - 1
            last[joint] = parent
        links = {"world": (-1, pin.SE3.Identity())}
        for frame in model.frames:
            links.setdefault(str(frame.name), (last[int(frame.parentJoint)], pin.SE3(frame.placement)))
        for thing in validation.strings("things", things):
            if thing in links:
                raise DuplicateNameError("things", thing, "a link of this name is there already")
            links[thing] = (len(frames), pin.SE3.Identity())
            frames.append(Frame(-1, pin.SE3.Identity(), Moves.FREE, len(free)))
            free.append(thing)
        return cls(tuple(frames), tuple(names), tuple(free), links)

    def link(self, what: str, name: str) -> tuple[int, pin.SE3]:
        """(number of the frame, pose of the link on it).

        Raises:
            UnknownNameError: no such link.
        """
        return self.links[validation.one_of(what, name, tuple(self.links))]

    @cached_property
    def places(self) -> Array:
        """Poses on the parents ``[frames, 12]``: rotation row by row, then position [m]."""
        return np.array([place(frame.place) for frame in self.frames]).reshape(-1, 12)

    def moved_by(self, names: tuple[str, ...], by: Mapping[int, tuple[int, float, float]]) -> Tree:
        """The same with other scalars x, of these names: scalar i is ratio x_k + offset, by[i] = (k, ratio, offset)."""
        frames = list(self.frames)
        for f, frame in enumerate(frames):
            if frame.moves in SCALAR:
                k, ratio, offset = by[frame.coordinate]
                scale, offset = frame.scale * ratio, frame.scale * offset + frame.offset
                frames[f] = replace(frame, coordinate=k, scale=scale, offset=offset)
        return replace(self, frames=tuple(frames), coordinates=names)

    def shifted(self, frame: int, by: Array) -> Tree:
        """The same with all that a frame carries moved by a vector in its axes [m]."""
        shift = pin.SE3(np.eye(3), by)
        frames = [replace(f, place=shift * f.place) if f.parent == frame else f for f in self.frames]
        links = {name: (k, shift * pose if k == frame else pose) for name, (k, pose) in self.links.items()}
        return replace(self, frames=tuple(frames), links=links)

    def about_z(self) -> Tree:
        """The same with frames turned so that scalars turn them about z or shift them along it."""
        turns = [_turn_to(frame.axis) if frame.moves in SCALAR else pin.SE3.Identity() for frame in self.frames]
        frames = []
        for turn, frame in zip(turns, self.frames, strict=True):
            at = frame.place * turn if frame.parent < 0 else turns[frame.parent].inverse() * frame.place * turn
            frames.append(replace(frame, place=at, axis=(0.0, 0.0, 1.0)))
        links = {name: (k, pose if k < 0 else turns[k].inverse() * pose) for name, (k, pose) in self.links.items()}
        return replace(self, frames=tuple(frames), links=links)

    def up(self, frame: int) -> list[int]:
        """A frame and those that carry it, up to the world."""
        out = []
        while frame >= 0:
            out.append(frame)
            frame = self.frames[frame].parent
        return out


def _turn_to(axis: tuple[float, float, float]) -> pin.SE3:
    """A turn that leads z to an axis."""
    z = np.array(axis) / np.linalg.norm(axis)
    x = np.cross(np.eye(3)[int(np.argmin(np.abs(z)))], z)
    x /= np.linalg.norm(x)
    return pin.SE3(np.column_stack([x, np.cross(z, x), z]), np.zeros(3))
