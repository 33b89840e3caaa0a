"""A robot that climbs or walks: a floating robot and the limbs by which it holds."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wbc import pickling, validation
from wbc.climb.contacts import ContactKind, Fixed, PointFoot
from wbc.errors import DuplicateNameError, RangeError, ShapeError, UnsupportedJointError
from wbc.multibody import pin
from wbc.robot import Robot
from wbc.robot.joint_values import joint_values, with_joint_values
from wbc.rotations import matrices
from wbc.symbolic.kinematics import frame_index
from wbc.validation import Array

#: How far a resting configuration may be beyond a limit, as files round their numbers [m, rad]
REST_SLACK = 1e-6


@dataclass(frozen=True, eq=False)
class ClimbLimb:
    """A chain of a robot by which it holds.

    Attributes:
        frame: frame of the robot at the limb's tip.
        contact: how it holds.
        placement: contact frame in ``frame``: its z axis is the outward normal of the surface that is held. A hand
            whose z axis approaches the surface has the rotation by pi about x.
        name: unique in a climber; the frame's name where it is empty.
    """

    frame: str
    contact: ContactKind = field(default_factory=PointFoot)
    placement: pin.SE3 = field(default_factory=pin.SE3.Identity)
    name: str = ""

    def __post_init__(self) -> None:
        validation.name("ClimbLimb.frame", self.frame)
        validation.instance("ClimbLimb.contact", self.contact, ContactKind, "a way to hold, see wbc.climb.ContactKind")
        object.__setattr__(self, "placement", validation.pose("ClimbLimb.placement", self.placement))
        object.__setattr__(self, "name", validation.name("ClimbLimb.name", self.name or self.frame))


@dataclass(frozen=True, eq=False)
class Climber:
    """A robot on a floating base with its limbs.

    The chain of a limb are the joints from the body (the link of the floating base) to its frame that no other limb
    has. Joints that two limbs share (a waist), or that belong to no limb, are held at ``rest``. The angles of a limb
    are the numbers of its chain's joints [m, rad], base first; of a joint without end its angle, and followers of a
    coupling inside the limb go with their leader.

    Attributes:
        robot: on a floating base, without closed loops.
        limbs: two or more.
        rest: configuration ``(nq)`` [m, rad] about which postures are sought; ``robot.neutral`` where it is None.
        name: short; the robot's where it is empty.
        height: of the body's origin over the places that it is told to go over [m]; 0: as at rest.

    Raises:
        ShapeError: no floating base, closed loops, less than two limbs, or a limb without a joint of its own.
        UnknownNameError: no such frame. DuplicateNameError: two limbs of one name. RangeError: ``rest`` is beyond a
        joint's limits. UnsupportedJointError: a limb has a ball joint, a joint that nothing drives, or one that is
        coupled to a joint elsewhere. NotFiniteError, RotationError: ``rest`` is no configuration.
    """

    robot: Robot
    limbs: Sequence[ClimbLimb]
    rest: Any = None
    name: str = ""
    height: float = 0.0

    def __post_init__(self) -> None:
        robot = validation.instance("Climber.robot", self.robot, Robot, "a wbc Robot, see wbc.robots.load")
        if robot.base != "floating":
            raise ShapeError("Climber.robot", robot.name, f"expected a floating base, and this one is {robot.base}")
        if robot.loops:
            raise ShapeError("Climber.robot", robot.name, "a robot with closed loops has no limbs that are chains")
        limbs = validation.items("Climber.limbs", self.limbs, "ClimbLimbs")
        for limb in limbs:
            validation.instance("Climber.limbs", limb, ClimbLimb, "ClimbLimbs")
            robot.check_frame(f"Climber.limbs, {limb.name}.frame", limb.frame)
        if len(limbs) < 2:
            raise ShapeError("Climber.limbs", [limb.name for limb in limbs], "expected two limbs or more")
        names = [limb.name for limb in limbs]
        for name in names:
            if names.count(name) > 1:
                raise DuplicateNameError("Climber.limbs", name, "two limbs of this name")
        object.__setattr__(self, "limbs", limbs)
        object.__setattr__(self, "name", validation.name("Climber.name", self.name or robot.name))
        validation.own_scalars(self, "height", low=0.0, unit="m")
        rest = robot.configuration("Climber.rest", robot.neutral if self.rest is None else self.rest)
        rest.flags.writeable = False
        object.__setattr__(self, "rest", rest)
        for row in range(len(limbs)):
            self._check_chain(row)
        self._check_rest()

    def __getstate__(self) -> dict[str, Any]:
        return pickling.declared(self)

    @cached_property
    def chains(self) -> tuple[tuple[int, ...], ...]:
        """Of each limb its joints' numbers in ``robot.model``, base first."""
        model = self.robot.model
        supports = []
        for limb in self.limbs:
            tip = model.frames[frame_index(model, limb.frame)].parentJoint
            supports.append([int(j) for j in model.supports[tip] if j > 1])
        shared = {j for k, one in enumerate(supports) for other in supports[k + 1 :] for j in set(one) & set(other)}
        return tuple(tuple(j for j in support if j not in shared) for support in supports)

    @cached_property
    def limits(self) -> tuple[tuple[Array, Array], ...]:
        """Lower and upper limits of each limb's angles [m, rad], those of followers counted in."""
        limits = self.robot.coupled(self.robot.limits)
        return tuple((limits.position_lower[dofs], limits.position_upper[dofs]) for dofs in self._dofs)

    @cached_property
    def mass(self) -> float:
        """Of the whole robot [kg]."""
        return float(pin.computeTotalMass(self.robot.model))

    def joints(self, limb: int) -> NDArray[np.intp]:
        """Rows in v of a limb's angles ``(k)``."""
        return self._dofs[limb]

    def fixed(self, limb: int) -> Fixed:
        """Rows of the contact's pose that a limb fixes while it holds."""
        return self.limbs[limb].contact.fixed

    def row(self, name: str) -> int:
        """Row of a limb.

        Raises:
            UnknownNameError: no such limb.
        """
        names = [limb.name for limb in self.limbs]
        return names.index(validation.one_of("limb", name, names))

    def carrier(self, frame: str) -> int:
        """Row of the limb whose joints move a frame of the robot; -1: none do."""
        model = self.robot.model
        support = set(model.supports[model.frames[frame_index(model, frame)].parentJoint])
        return next((limb for limb, chain in enumerate(self.chains) if support & set(chain)), -1)

    def body_pose(self, q: Array) -> pin.SE3:
        """Pose of the link of the floating base in the world."""
        return self._root * pin.XYZQUATToSE3(np.asarray(q[:7]))

    def with_body(self, q: Array, pose: pin.SE3) -> Array:
        """A configuration with the body elsewhere and the joints as they are."""
        out = np.array(q, dtype=np.float64)
        out[:7] = pin.SE3ToXYZQUAT(self._root.actInv(pose))
        return out

    def angles(self, q: Array, limb: int) -> Array:
        """A limb's angles ``(k)`` [m, rad] in a configuration; of joints without end within (-pi, pi]."""
        return np.asarray(joint_values(self.robot, np.asarray(q)[None])[0, self._dofs[limb] - 6])

    def with_limb(self, q: Array, limb: int, angles: Array) -> Array:
        """A configuration with a limb's angles, and those of its followers; or ``(n, nq)`` with ``(n, k)``."""
        rows = np.atleast_2d(q)
        values = joint_values(self.robot, rows)
        values[:, self._dofs[limb] - 6] = angles
        return self.with_values(rows, values).reshape(np.shape(q))

    def with_values(self, q: Array, values: Array) -> Array:
        """Configurations ``(n, nq)`` with other numbers of joints ``(n, nv - 6)``, followers with their leaders."""
        for coupling in self.robot.couplings:
            values[:, coupling.follower - 6] = coupling.ratio * values[:, coupling.leader - 6] + coupling.offset
        return with_joint_values(self.robot, q, values)

    def states(self, q: Array) -> Array:
        """Poses of the body, rotation row by row, then position, and angles of all limbs ``(n, 12 + k)`` of
        configurations ``(n, nq)`` that follow each other.
        """
        rotation, values = (self._root.rotation @ matrices(q[:, 3:7])).reshape(-1, 9), joint_values(self.robot, q)
        angles = [values[:, dofs - 6] for dofs in self._dofs]
        return np.hstack([rotation, q[:, :3] @ self._root.rotation.T + self._root.translation, *angles])

    def with_states(self, q: Array, states: Array, body: bool = True) -> Array:
        """Configurations ``(n, nq)`` with the angles of some :meth:`states`, and their bodies or not."""
        values = joint_values(self.robot, q)
        values[:, np.concatenate(self._dofs) - 6] = states[:, 12:]
        out = self.with_values(q, values)
        for row, at in zip(out, states if body else (), strict=body):
            row[:7] = pin.SE3ToXYZQUAT(self._root.actInv(pin.SE3(at[:9].reshape(3, 3), at[9:12])))
        return out

    def contact_pose(self, q: Array, limb: int) -> pin.SE3:
        """Pose in the world of a limb's contact frame, z from the surface to the robot."""
        model, data = self.robot.model, self._data
        pin.forwardKinematics(model, data, np.asarray(q, dtype=np.float64))
        frame = pin.updateFramePlacement(model, data, frame_index(model, self.limbs[limb].frame))
        return frame * self.limbs[limb].placement

    def center_of_mass(self, q: Array) -> Array:
        """Centre of mass in the world ``(3)`` [m]; of a robot without masses the origin of its body."""
        if self.mass <= 0.0:
            return np.array(self.body_pose(q).translation)
        return np.array(pin.centerOfMass(self.robot.model, self._data, np.asarray(q, dtype=np.float64)))

    @cached_property
    def _data(self) -> pin.Data:
        return self.robot.model.createData()

    @cached_property
    def _root(self) -> pin.SE3:
        return self.robot.model.jointPlacements[1].copy()

    @cached_property
    def _dofs(self) -> tuple[NDArray[np.intp], ...]:
        """Places in v of the chains' joints, followers left out."""
        model, followers = self.robot.model, {coupling.follower for coupling in self.robot.couplings}
        out = []
        for chain in self.chains:
            dofs = [int(model.idx_vs[j]) + k for j in chain for k in range(int(model.nvs[j]))]
            own = [dof for dof in dofs if dof not in followers]
            out.append(np.array(list(dict.fromkeys(own)), dtype=np.intp))
        return tuple(out)

    def _check_chain(self, limb: int) -> None:
        robot, chain, field_name = self.robot, self.chains[limb], f"Climber.limbs, {self.limbs[limb].name}"
        if not chain:
            reason = "no joint between the body and this frame belongs to this limb alone, so it is no chain"
            raise ShapeError(field_name, self.limbs[limb].frame, reason)
        model, idle = robot.model, {*robot.passive, *robot.locked_dofs}
        for j in chain:
            name, dofs = str(model.names[j]), range(int(model.idx_vs[j]), int(model.idx_vs[j]) + int(model.nvs[j]))
            if int(model.nqs[j]) == 4 and int(model.nvs[j]) == 3:
                raise UnsupportedJointError(f"{field_name}, {name}", "ball joint", "a limb's joints each have numbers")
            if int(model.nqs[j]) == 7 or not idle.isdisjoint(dofs):
                raise UnsupportedJointError(f"{field_name}, {name}", "passive", "nothing drives this joint of the limb")
        inside = {int(model.idx_vs[j]) + k for j in chain for k in range(int(model.nvs[j]))}
        for coupling in robot.couplings:
            ends = coupling.follower, coupling.leader
            if sum(dof in inside for dof in ends) == 1:
                names = " follows ".join(robot.dof_names[dof] for dof in ends)
                raise UnsupportedJointError(field_name, names, "a coupling joins this limb to a joint elsewhere")
        followers = {int(f): int(k) for f, k in zip(model.mimicking_joints, model.mimicked_joints, strict=True)}
        for follower, leader in followers.items():
            if (follower in chain) != (leader in chain):
                names = f"{model.names[follower]} follows {model.names[leader]}"
                raise UnsupportedJointError(field_name, names, "a coupling joins this limb to a joint elsewhere")

    def _check_rest(self) -> None:
        limits, index = self.robot.limits, self.robot.position_index
        for dof in np.flatnonzero(index >= 0):
            value, low, high = self.rest[index[dof]], limits.position_lower[dof], limits.position_upper[dof]
            if not low - REST_SLACK <= value <= high + REST_SLACK:
                reason = f"beyond its limits [{low:.6g}, {high:.6g}] {self.robot.dof_units[dof]}"
                raise RangeError(f"Climber.rest, {self.robot.dof_names[dof]}", float(value), reason)
