"""Symbolic kinematics of a ``pin.Model``: poses, Jacobians, centre of mass, manifold maps.

Everything is built on first use and kept, so two items that ask for the same frame share one
expression graph. Frame order, twist order (linear; angular) and reference frames are Pinocchio's,
which is the referee in the tests.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import casadi as ca
import pinocchio as pin

from wbc.errors import UnknownNameError
from wbc.symbolic import rotations as rot
from wbc.symbolic.joints import SymbolicJoint, symbolic_joint

WORLD = "world"

#: Reference frames of a Jacobian: ``world_aligned`` (at the frame's origin, world axes),
#: ``local`` (at the origin, own axes), ``world`` (at the world's origin, world axes).
REFERENCES = ("world_aligned", "local", "world")


@dataclass(frozen=True)
class Pose:
    """A pose as expressions: 3x3 rotation and 3-vector position of a frame in the world."""

    rotation: ca.SX
    position: ca.SX

    def point(self, offset: ca.SX) -> ca.SX:
        """A point given in this frame, in the world: p + R offset."""
        return self.position + self.rotation @ offset

    def inverse_point(self, point: ca.SX) -> ca.SX:
        """A point given in the world, in this frame: R' (point - p)."""
        return self.rotation.T @ (point - self.position)

    def times(self, other: Pose) -> Pose:
        """Composition of poses."""
        return Pose(self.rotation @ other.rotation, self.point(other.position))

    def inverse(self) -> Pose:
        """Inverse pose."""
        return Pose(self.rotation.T, -(self.rotation.T @ self.position))


class Kinematics:
    """Expressions of one model in one configuration symbol ``q`` (nq) and velocity symbol ``v`` (nv)."""

    def __init__(self, model: pin.Model) -> None:
        self.model = model
        self.nq, self.nv = int(model.nq), int(model.nv)
        self.q = ca.SX.sym("q", self.nq)
        self.v = ca.SX.sym("v", self.nv)
        names = list(model.names)
        self.joints: list[SymbolicJoint | None] = [None]
        self.joints += [symbolic_joint(model.joints[j], names[j]) for j in range(1, model.njoints)]
        self._poses: dict[int, Pose] = {0: Pose(ca.SX(ca.DM.eye(3)), ca.SX(3, 1))}
        self._columns: dict[int, tuple[ca.SX, ca.SX]] = {}
        self._frames: dict[str, tuple[int, Pose]] = {}
        self._jacobians: dict[tuple[str, str], ca.SX] = {}

    def joint_q(self, joint: int) -> ca.SX:
        """Coordinates of joint number ``joint``."""
        start = int(self.model.idx_qs[joint])
        return self.q[start : start + int(self.model.nqs[joint])]

    def joint_columns(self, joint: int) -> slice:
        """Where the velocities of joint number ``joint`` stand in v."""
        start = int(self.model.idx_vs[joint])
        return slice(start, start + int(self.model.nvs[joint]))

    def joint_pose(self, joint: int) -> Pose:
        """Pose of the child side of a joint in the world (Pinocchio's oMi)."""
        known = self._poses.get(joint)
        if known is not None:
            return known
        parent = self.joint_pose(int(self.model.parents[joint]))
        fixed = self.model.jointPlacements[joint]
        base = parent.times(Pose(rot.constant(fixed.rotation), rot.constant(fixed.translation)))
        symbolic = self.joints[joint]
        assert symbolic is not None
        rotation, position = symbolic.placement(self.joint_q(joint))
        pose = base.times(Pose(rotation, position))
        self._poses[joint] = pose
        return pose

    def joint_twist(self, joint: int) -> tuple[ca.SX, ca.SX]:
        """(linear 3 x nv_j at the joint's origin, angular 3 x nv_j), world axes, of the joint's own motion."""
        known = self._columns.get(joint)
        if known is None:
            symbolic = self.joints[joint]
            assert symbolic is not None
            subspace = ca.sparsify(symbolic.subspace(self.joint_q(joint)))
            rotation = self.joint_pose(joint).rotation
            known = (ca.sparsify(rotation @ subspace[:3, :]), ca.sparsify(rotation @ subspace[3:, :]))
            self._columns[joint] = known
        return known

    def support(self, joint: int) -> list[int]:
        """Joints from the root to ``joint``."""
        out = []
        while joint > 0:
            out.append(joint)
            joint = int(self.model.parents[joint])
        return out[::-1]

    def frame(self, name: str) -> tuple[int, Pose]:
        """(parent joint, fixed placement in it) of a named frame; ``"world"`` is the fixed root.

        Raises:
            UnknownNameError: no frame of that name.
        """
        known = self._frames.get(name)
        if known is None:
            if name == WORLD:
                known = (0, self._poses[0])
            elif self.model.existFrame(name):
                frame = self.model.frames[self.model.getFrameId(name)]
                place = frame.placement
                known = (int(frame.parentJoint), Pose(rot.constant(place.rotation), rot.constant(place.translation)))
            else:
                raise UnknownNameError("frame", name, [f.name for f in self.model.frames])
            self._frames[name] = known
        return known

    def pose(self, frame: str) -> Pose:
        """Pose of a named frame in the world."""
        joint, placement = self.frame(frame)
        return self.joint_pose(joint).times(placement)

    def jacobian(self, frame: str, reference: str = "world_aligned") -> ca.SX:
        """6 x nv Jacobian (linear; angular) of a named frame in one of :data:`REFERENCES`."""
        if reference not in REFERENCES:
            raise UnknownNameError("reference", reference, REFERENCES)
        key = (frame, reference)
        known = self._jacobians.get(key)
        if known is None:
            pose = self.pose(frame)
            point = ca.SX(3, 1) if reference == "world" else pose.position
            known = self.point_jacobian(self.frame(frame)[0], point)
            if reference == "local":
                turn = pose.rotation.T
                known = ca.vertcat(turn @ known[:3, :], turn @ known[3:, :])
            self._jacobians[key] = known
        return known

    def point_jacobian(self, joint: int, point: ca.SX) -> ca.SX:
        """6 x nv Jacobian, world axes, of the point of body ``joint`` that is at ``point`` now."""
        out = ca.SX(6, self.nv)
        for k in self.support(joint):
            linear, angular = self.joint_twist(k)
            arm = point - self.joint_pose(k).position
            columns = self.joint_columns(k)
            if angular.nnz():
                linear = linear - rot.skew(arm) @ angular
            out[:3, columns] = linear
            out[3:, columns] = angular
        return ca.sparsify(out)

    @cached_property
    def _subtrees(self) -> list[tuple[float, ca.SX]]:
        """Per joint: mass of its subtree and the first moment of that mass, in the world."""
        masses = [0.0] * self.model.njoints
        moments = [ca.SX(3, 1) for _ in masses]
        for j in range(self.model.njoints - 1, 0, -1):
            inertia = self.model.inertias[j]
            if inertia.mass > 0.0:
                masses[j] += float(inertia.mass)
                moments[j] = moments[j] + inertia.mass * self.joint_pose(j).point(rot.constant(inertia.lever))
            parent = int(self.model.parents[j])
            masses[parent] += masses[j]
            moments[parent] = moments[parent] + moments[j]
        return list(zip(masses, moments, strict=True))

    @cached_property
    def center_of_mass(self) -> ca.SX:
        """Centre of mass in the world [m], as Pinocchio's: bodies welded to the world do not count; 0 for no mass."""
        mass, moment = self._subtrees[0]
        return moment / mass if mass > 0.0 else ca.SX.zeros(3)

    @cached_property
    def center_of_mass_jacobian(self) -> ca.SX:
        """3 x nv Jacobian of :attr:`center_of_mass`: per joint, twist of the subtree's mass over all mass."""
        total = self._subtrees[0][0]
        out = ca.SX(3, self.nv)
        for j in range(1, self.model.njoints):
            mass, moment = self._subtrees[j]
            if mass <= 0.0:
                continue
            linear, angular = self.joint_twist(j)
            arm = moment - mass * self.joint_pose(j).position
            out[:, self.joint_columns(j)] = (mass * linear - rot.skew(arm) @ angular) / total
        return ca.sparsify(out)

    @cached_property
    def tangent_map(self) -> ca.SX:
        """T(q), nq x nv, with dq/dt = T(q) v."""
        return self.tangent_map_at(self.q)

    def tangent_map_at(self, q: ca.SX) -> ca.SX:
        """T at another configuration."""
        blocks = [j.tangent(qj) for _, j, qj, _ in self._split(q, self.v)]
        return ca.sparsify(ca.diagcat(*blocks)) if blocks else ca.SX(0, 0)

    def integrate(self, q: ca.SX, v: ca.SX) -> ca.SX:
        """q (+) v on the manifold (unit time)."""
        return ca.vertcat(*[j.integrate(qj, vj) for _, j, qj, vj in self._split(q, v)])

    def difference(self, q0: ca.SX, q1: ca.SX) -> ca.SX:
        """v with q0 (+) v = q1, the shortest."""
        out = []
        for k, symbolic, a, _ in self._split(q0, self.v):
            start = int(self.model.idx_qs[k])
            out.append(symbolic.difference(a, q1[start : start + symbolic.nq]))
        return ca.vertcat(*out)

    def _split(self, q: ca.SX, v: ca.SX) -> list[tuple[int, SymbolicJoint, ca.SX, ca.SX]]:
        out = []
        for k in range(1, self.model.njoints):
            symbolic = self.joints[k]
            assert symbolic is not None
            start = int(self.model.idx_qs[k])
            out.append((k, symbolic, q[start : start + symbolic.nq], v[self.joint_columns(k)]))
        return out
