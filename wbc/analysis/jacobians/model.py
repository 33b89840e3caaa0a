"""``ExactModel``: the kinematics of a robot in exact arithmetic."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from wbc import validation
from wbc.analysis.algebra.ring import Coordinate, Matrix, TrigRing
from wbc.analysis.algebra.transforms import SNAP, Transform, Vector, apply, exact_placement, exact_rotation, identity
from wbc.errors import UnsupportedJointError
from wbc.multibody import pin
from wbc.robot import Robot
from wbc.robot.robot import checked_robot
from wbc.symbolic.kinematics import WORLD, frame_index
from wbc.validation import Array


class ExactModel:
    """A robot whose joints turn about, or slide along, one axis each, serial or a tree, on a fixed base.

    Attributes:
        robot: the robot. ring: polynomials of its joint variables; joint i of the text is number i in v, from 1.
        approximate: whether rotations may be. notes: those that were.
    """

    def __init__(self, robot: Robot, symbols: Mapping[str, float] | None = None, *, approximate: bool = False) -> None:
        """Reads the model.

        Args:
            symbols: name -> length [m]; every translation of the model with that absolute value becomes the symbol.
            approximate: rotations other than by multiples of 90 degrees by rational ones, see ``notes``.

        Raises:
            UnsupportedJointError: a joint that neither turns about nor slides along one axis.
            RotationError: a rotation that is not exact, without ``approximate``.
            DuplicateNameError, RangeError: symbols that cannot be distinguished, or that are zero.
        """
        self.robot, self.notes = checked_robot(robot), list[str]()
        self.approximate = approximate = validation.flag("approximate", approximate)
        if symbols is not None:
            symbols = validation.mapping("symbols", symbols, "names to lengths")
        model = robot.model
        axes = [self._axis(j, approximate) for j in range(1, model.njoints)]
        coordinates = [
            Coordinate(int(model.idx_vs[j]), int(model.idx_qs[j]), str(int(model.idx_vs[j]) + 1), slides)
            for j, (_, slides) in enumerate(axes, start=1)
        ]
        self.ring = TrigRing(coordinates, symbols)
        self._axes = [[self.ring.constant(x) for x in axis] for axis, _ in axes]
        self._fixed = [
            exact_placement(self.ring, model.jointPlacements[j], f"joint {model.names[j]!r}", approximate, self.notes)
            for j in range(1, model.njoints)
        ]
        self._frames: dict[str, tuple[int, Transform]] = {WORLD: (0, identity(self.ring))}
        self._seen: dict[tuple[str, int], Transform] = {}
        #: Rows of declarations as they were worked out before, see :func:`symbolic_jacobian`
        self.blocks: dict[Any, tuple[Matrix, str]] = {}

    def frame(self, name: str) -> tuple[int, Transform]:
        """The joint that moves a frame (0: none) and the frame's placement on it.

        Raises:
            UnknownNameError: no such frame. RotationError: see :class:`ExactModel`.
        """
        self.robot.check_frame("frame", name)
        if name not in self._frames:
            frame = self.robot.model.frames[frame_index(self.robot.model, name)]
            placement = exact_placement(self.ring, frame.placement, f"frame {name!r}", self.approximate, self.notes)
            self._frames[name] = int(frame.parentJoint), placement
        return self._frames[name]

    def support(self, joint: int) -> tuple[int, ...]:
        """Joints between the world and a joint, itself included."""
        joint = validation.integer("joint", joint, high=self.robot.model.njoints - 1)
        return tuple(int(j) for j in self.robot.model.supports[joint] if j)

    def joint_in(self, seen_from: str, joint: int) -> Transform:
        """Where a joint's frame is, seen from a frame: only joints between the two appear in it."""
        joint = validation.integer("joint", joint, high=self.robot.model.njoints - 1)
        key = self.robot.check_frame("frame", seen_from), joint
        if key not in self._seen:
            start, placement = self.frame(seen_from)
            if joint == start:
                self._seen[key] = placement.inverse(self.ring)
            elif joint in (0, *self.support(start)):
                above = next(j for j in (*self.support(start),) if self._parent(j) == joint)
                step = self._step(above).inverse(self.ring)
                self._seen[key] = self.joint_in(seen_from, above).times(step, self.ring)
            else:
                below = self.joint_in(seen_from, self._parent(joint))
                self._seen[key] = below.times(self._step(joint), self.ring)
        return self._seen[key]

    def frame_in(self, seen_from: str, name: str) -> Transform:
        """Where a frame is, seen from another."""
        joint, placement = self.frame(name)
        return self.joint_in(seen_from, joint).times(placement, self.ring)

    def axis_in(self, seen_from: str, joint: int) -> Vector:
        """The axis of a joint, seen from a frame."""
        validation.integer("joint", joint, low=1)
        return apply(self.joint_in(seen_from, joint).rotation, self._axes[joint - 1], self.ring)

    def distinct_frames(self) -> tuple[str, ...]:
        """One frame a joint, and the world: what rows may be expressed in."""
        out = {0: WORLD}
        links_first = sorted(self.robot.model.frames, key=lambda frame: frame.type != pin.FrameType.BODY)
        for frame in links_first:
            out.setdefault(int(frame.parentJoint), str(frame.name))
        return tuple(out[j] for j in sorted(out))

    def configuration(self, values: Any) -> Array:
        """A configuration of the robot from one number a joint."""
        values = validation.ordinary_array("values", values, (len(self.ring.coordinates),))
        q = self.robot.neutral.copy()
        for joint, value in zip(self.ring.coordinates, values, strict=True):
            if int(self.robot.model.nqs[joint.dof + 1]) == 2:
                q[joint.index : joint.index + 2] = np.cos(value), np.sin(value)
            else:
                q[joint.index] = value
        return q

    def _parent(self, joint: int) -> int:
        return int(self.robot.model.parents[joint])

    def _step(self, joint: int) -> Transform:
        """From a joint's parent to the joint, turned or shifted by its coordinate."""
        ring, k, axis = self.ring, joint - 1, self._axes[joint - 1]
        if ring.coordinates[k].slides:
            moved = Transform(identity(ring).rotation, [x * ring.displacement(k) for x in axis])
            return self._fixed[k].times(moved, ring)
        c, s = ring.cosine(k), ring.sine(k)
        a, b, d = axis
        skew = [[ring.zero, -d, b], [d, ring.zero, -a], [-b, a, ring.zero]]
        turn = [
            [(c if i == j else ring.zero) + s * skew[i][j] + (1 - c) * axis[i] * axis[j] for j in range(3)]
            for i in range(3)
        ]
        return self._fixed[k].times(Transform(turn, [ring.zero] * 3), ring)

    def _axis(self, joint: int, approximate: bool) -> tuple[list[Any], bool]:
        """Exact unit axis in the joint's frame, and whether the joint slides along it."""
        model = self.robot.model
        name, kind = f"joint {model.names[joint]!r}", model.joints[joint].shortname()
        if int(model.nvs[joint]) != 1 or "Mimic" in kind or "Composite" in kind:
            raise UnsupportedJointError(name, kind, "rank analysis needs joints that turn or slide along one axis")
        data = model.joints[joint].createData()
        model.joints[joint].calc(data, pin.neutral(model))
        motion = np.asarray(data.S, dtype=float).reshape(6)
        slide, turn = np.linalg.norm(motion[:3]) > SNAP, np.linalg.norm(motion[3:]) > SNAP
        if slide and turn:
            raise UnsupportedJointError(name, kind, "rank analysis needs joints that turn or slide along one axis")
        axis = motion[:3] if slide else motion[3:]
        to_axis = pin.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), axis).matrix()
        rows = exact_rotation(to_axis, f"axis of {name}", approximate, self.notes)
        return [row[2] for row in rows], bool(slide)


def checked_model(model: Any) -> ExactModel:
    """The model that a user hands in.

    Raises:
        ShapeError: something else.
    """
    return validation.instance("model", model, ExactModel, "an ExactModel")
