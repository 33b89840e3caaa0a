"""Motions that other programs recorded: joints and frames over time."""

from __future__ import annotations

import fnmatch
import logging
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from wbc import validation
from wbc.errors import UnknownNameError
from wbc.formats.errors import FormatError
from wbc.multibody import pin
from wbc.robot.robot import Robot, checked_robot
from wbc.validation import Array

log = logging.getLogger("wbc")


@dataclass(frozen=True, eq=False)
class Path6:
    """A frame in its parent over time: ``t`` [n] s, ``poses`` [n x 7]: x, y, z [m], quaternion x, y, z, w."""

    parent: str
    t: Array
    poses: Array

    def at(self, time: float) -> pin.SE3:
        """The pose at a time [s], along the screw between its neighbours; before and after them theirs."""
        k = int(np.clip(np.searchsorted(self.t, time, side="right") - 1, 0, len(self.t) - 1))
        if k + 1 == len(self.t) or time <= self.t[k]:
            return pin.XYZQUATToSE3(self.poses[k])
        share = (time - self.t[k]) / (self.t[k + 1] - self.t[k])
        return pin.SE3.Interpolate(*map(pin.XYZQUATToSE3, self.poses[k : k + 2]), share)


@dataclass(frozen=True, eq=False)
class RecordedMotion:
    """Joints and frames over time.

    Attributes:
        joints: names. t: times of ``q`` [n], from the first message on [s], but those of frames with one pose alone.
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
        if relative_to and above != relative_to:
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
        robot = checked_robot(robot)
        model, out = robot.model, np.tile(robot.neutral, (len(self.t), 1))
        for name, values in zip(self.joints, self.q.T, strict=True):
            if not model.existJointName(name):
                if any(fnmatch.fnmatch(name, pattern) for pattern in ignored):
                    continue
                raise UnknownNameError("joint", name, robot.joint_names)
            number = model.getJointId(name)
            first = int(model.idx_qs[number])
            if model.nvs[number] != 1:
                raise FormatError("joint", name, "has several degrees of freedom; its state is no one number")
            out[:, first] = values
            if model.nqs[number] == 2:
                out[:, first], out[:, first + 1] = np.cos(values), np.sin(values)
        if still := [name for name in robot.joint_names if name not in self.joints]:
            log.warning("nothing is recorded of these joints, which stand as in neutral: %s", ", ".join(still))
        return out
