"""Motions that other programs recorded: joints and frames over time, as targets and in place of a robot."""

from __future__ import annotations

import fnmatch
import logging
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from wbc import validation
from wbc.formats.errors import FormatError
from wbc.multibody import pin
from wbc.robot.robot import Robot, checked_robot
from wbc.simulation import CommandKind, KinematicPlant, PlantState
from wbc.validation import Array

log = logging.getLogger("wbc")

#: Times that differ by less are one [s]
AT_ONCE = 1e-9


@dataclass(frozen=True, eq=False)
class Path6:
    """A frame in its parent over time: ``t`` [n] s, ``poses`` [n x 7]: x, y, z [m], quaternion x, y, z, w."""

    parent: str
    t: Array
    poses: Array

    def at(self, time: float) -> pin.SE3:
        """The pose at a time [s], along the screw between its neighbours; before and after them theirs."""
        place = float(np.interp(time, self.t, np.arange(len(self.t))))
        around = (pin.XYZQUATToSE3(self.poses[k]) for k in (math.floor(place), math.ceil(place)))
        return pin.SE3.Interpolate(*around, place % 1.0)


@dataclass(frozen=True, eq=False)
class RecordedMotion:
    """Joints and frames over time.

    Attributes:
        joints: names. t: times of ``q`` [n], from the first message on [s], but those of what is said once alone.
        q: positions [n x joints, rad or m]; a joint that a message does not name has its last one.
        v: velocities [n x joints, rad/s or m/s]; None where a message gives none, or NaN.
        frames: name -> the frame in its parent.
        remarks: topics that are not read, and why; times that go back, stand still, or are of several clocks.
    """

    joints: tuple[str, ...]
    t: Array
    q: Array
    v: Array | None
    frames: Mapping[str, Path6]
    remarks: tuple[str, ...] = ()

    def pose(self, frame: str, time: float, relative_to: str = "") -> pin.SE3:
        """A frame at a time [s], as a target: in the root of its tree, or in a frame above it.

        Raises:
            UnknownNameError: no such frame. FormatError: frames that are each other's parents, or no such one above.
        """
        validation.one_of("frame", frame, self.frames)
        out, above, passed = pin.SE3.Identity(), frame, set[str]()
        while above in self.frames and above != relative_to:
            if above in passed:
                raise FormatError("frame", frame, f"is placed in a circle through {above}")
            passed.add(above)
            out, above = self.frames[above].at(time) * out, self.frames[above].parent
        if relative_to not in ("", above):
            raise FormatError("relative_to", relative_to, f"{frame} does not hang on it, but on {above}")
        return out

    def at(self, time: float) -> Array:
        """Positions of all joints at a time [s], linear between messages, at the ends theirs."""
        return np.array([np.interp(time, self.t, column) for column in self.q.T])

    def configurations(self, robot: Robot, ignored: Sequence[str] = ()) -> Array:
        """Configurations [n, nq]; joints of the robot that nothing is recorded of stand as in its neutral one.

        Args:
            ignored: names or patterns of recorded joints that the robot need not have.

        Raises:
            UnknownNameError: a recorded joint that the robot has not. FormatError: one with several coordinates.
        """
        model, out = checked_robot(robot).model, np.tile(robot.neutral, (len(self.t), 1))
        for name, values in zip(self.joints, self.q.T, strict=True):
            if name not in robot.joint_names and any(fnmatch.fnmatch(name, pattern) for pattern in ignored):
                continue
            dofs, number = robot.dofs(name), model.getJointId(name)
            if dofs.stop - dofs.start != 1:
                raise FormatError("joint", name, "has several degrees of freedom; its state is no one number")
            # A joint without end has a cosine and a sine
            columns = [values] if model.nqs[number] == 1 else [np.cos(values), np.sin(values)]
            out[:, model.idx_qs[number] : model.idx_qs[number] + len(columns)] = np.column_stack(columns)
        if still := [name for name in robot.joint_names if name not in self.joints]:
            log.warning("nothing is recorded of these joints, which stand as in neutral: %s", ", ".join(still))
        return out


class PlayedPlant(KinematicPlant):
    """A plant that moves as was recorded, whatever it is commanded.

    Args:
        robot: whose joints they are. motion: what was recorded, two states or more.
        ignored: as of :meth:`wbc.formats.RecordedMotion.configurations`.

    Raises:
        FormatError: less than two states. UnknownNameError: a joint that the robot has not.
    """

    commands = tuple(CommandKind)

    def __init__(self, robot: Robot, motion: RecordedMotion, ignored: Sequence[str] = ()) -> None:
        if len(motion.t) < 2:
            raise FormatError("motion", len(motion.t), "expected two joint states or more")
        self._robot, self._t, self._recorded = robot, motion.t, motion.configurations(robot, ignored)
        super().__init__(robot)

    def reset(self, q: Array, time: float) -> None:
        """Begin the recording anew; ``q`` is not gone to: read says where the robot was."""
        self._time, self._shift = float(self._t[0]), time - float(self._t[0])

    def read(self) -> PlantState:
        """On the line between two recorded states, with the velocity along it; invalid after the last one."""
        t, now = self._t, self._time
        k = int(np.clip(np.searchsorted(t, now - AT_ONCE) - 1, 0, len(t) - 2))
        v = self._robot.difference(*self._recorded[k : k + 2]) / (t[k + 1] - t[k])
        q = self._robot.integrate(self._recorded[k], v, float(np.clip(now, t[k], t[k + 1]) - t[k]))
        return PlantState(q, v, now + self._shift, valid=bool(now <= t[-1] + AT_ONCE))

    def advance(self, dt: float) -> None:
        self._time += dt

    def states(self, dt: float) -> Iterator[PlantState]:
        """The states that were recorded, every ``dt`` [s] from the first one on, at the times of the recording: steps
        of a controller there are what its stack would have done.
        """
        self.reset(self._recorded[0], float(self._t[0]))
        while (state := self.read()).valid:
            yield state
            self.advance(dt)
