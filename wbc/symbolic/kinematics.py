"""Symbolic kinematics of a ``pin.Model``: poses, Jacobians, centre of mass, manifold maps.

Everything is built on first use and kept, so two items that ask for the same frame share one
expression graph. Frame order, twist order (linear; angular) and reference frames are Pinocchio's,
which is the referee in the tests.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from functools import cached_property

import casadi as ca

from wbc.errors import UnknownNameError
from wbc.multibody import algebra, own
from wbc.quick_dataclasses import dataclass
from wbc.symbolic import kernels, rotations as rot
from wbc.symbolic.joint_maps import eye
from wbc.symbolic.joints import SymbolicJoint, mimic_joint, symbolic_joint

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
        return Pose(*kernels.compose()(self.rotation, self.position, other.rotation, other.position))

    def inverse(self) -> Pose:
        """Inverse pose."""
        return Pose(self.rotation.T, -(self.rotation.T @ self.position))


#: Which frame a name means where a description gives it to several, first come first served.
_FRAME_TYPES = ("BODY", "JOINT", "FIXED_JOINT", "OP_FRAME", "SENSOR")


def frame_index(model: own.Model, name: str) -> int:
    """Number of a named frame; of a link and a joint of one name, the link (ANYmal C names both ``LF_HAA``).

    Raises:
        UnknownNameError: no frame of that name.
    """
    for kind in (getattr(algebra(model).FrameType, word) for word in _FRAME_TYPES):
        if model.existFrame(name, kind):
            return int(model.getFrameId(name, kind))
    raise UnknownNameError("frame", name, [f.name for f in model.frames])


def joint_of(model: own.Model, frame: str) -> int:
    """Number of the joint that carries a frame; 0 for the world and for what no joint moves.

    Raises:
        UnknownNameError: no frame of that name.
    """
    return 0 if frame == WORLD else int(model.frames[frame_index(model, frame)].parentJoint)


class Kinematics:
    """Expressions of one model in one configuration symbol ``q`` (nq) and velocity symbol ``v`` (nv)."""

    def __init__(self, model: own.Model) -> None:
        self.model = model
        self.nq, self.nv = int(model.nq), int(model.nv)
        self.njoints = int(model.njoints)
        self.q = ca.SX.sym("q", self.nq)
        self.v = ca.SX.sym("v", self.nv)
        self.parents = [int(p) for p in model.parents]
        self._fill_joints()
        self._poses: dict[int, Pose] = {0: Pose(ca.SX(ca.DM.eye(3)), ca.SX(3, 1))}
        self._local: dict[int, Pose] = {}
        self._subspaces: dict[int, tuple[ca.SX, ca.SX]] = {}
        self._chains: dict[int, tuple[ca.SX, ca.SX, ca.SX]] = {}
        self._columns: dict[int, tuple[ca.SX, ca.SX]] = {}
        self._frames: dict[str, tuple[int, Pose]] = {}
        self._jacobians: dict[tuple[str, str], ca.SX] = {}

    def _fill_joints(self) -> None:
        """The joints' maps and where each reads q and v; a mimic joint reads its leader's and owns none."""
        model = self.model
        followers = {int(f): int(k) for f, k in zip(model.mimicking_joints, model.mimicked_joints, strict=True)}
        self.joints: list[SymbolicJoint | None] = [None]
        self.followers = frozenset(followers)
        for j in range(1, self.njoints):
            name, leader = str(model.names[j]), followers.get(j)
            own = symbolic_joint(model.joints[followers.get(j, j)], name)
            self.joints.append(own if leader is None else mimic_joint(model.joints[j], own, name))
        iq, iv = [int(i) for i in model.idx_qs], [int(i) for i in model.idx_vs]
        self._q_slices = [slice(i, i + (j.nq if j else 0)) for i, j in zip(iq, self.joints, strict=True)]
        self._v_slices = [slice(i, i + (j.nv if j else 0)) for i, j in zip(iv, self.joints, strict=True)]

    def joint_q(self, joint: int) -> ca.SX:
        """Coordinates of joint number ``joint``; of its leader for a mimic joint."""
        return self.q[self._q_slices[joint]]

    def joint_columns(self, joint: int) -> slice:
        """Where the velocities of joint number ``joint`` stand in v; those of its leader for a mimic joint."""
        return self._v_slices[joint]

    def symbolic(self, joint: int) -> SymbolicJoint:
        """The maps of joint number ``joint`` (1 to njoints - 1)."""
        maps = self.joints[joint]
        assert maps is not None
        return maps

    def local_pose(self, joint: int) -> Pose:
        """Pose of the child side of a joint in the child side of its parent joint (Pinocchio's liMi)."""
        known = self._local.get(joint)
        if known is None:
            fixed = self.model.jointPlacements[joint]
            rotation, position = self.symbolic(joint).placement(self.joint_q(joint))
            base = Pose(rot.constant(fixed.rotation), rot.constant(fixed.translation))
            known = base.times(Pose(rotation, position))
            self._local[joint] = known
        return known

    def joint_pose(self, joint: int) -> Pose:
        """Pose of the child side of a joint in the world (Pinocchio's oMi)."""
        known = self._poses.get(joint)
        if known is None:
            known = self.joint_pose(self.parents[joint]).times(self.local_pose(joint))
            self._poses[joint] = known
        return known

    def joint_subspace(self, joint: int) -> tuple[ca.SX, ca.SX]:
        """(linear 3 x nv_j, angular 3 x nv_j), child axes, of the joint's own motion: S(q)."""
        known = self._subspaces.get(joint)
        if known is None:
            subspace = ca.sparsify(self.symbolic(joint).subspace(self.joint_q(joint)))
            known = (subspace[:3, :], subspace[3:, :])
            self._subspaces[joint] = known
        return known

    def joint_twist(self, joint: int) -> tuple[ca.SX, ca.SX]:
        """(linear 3 x nv_j at the joint's origin, angular 3 x nv_j), world axes, of the joint's own motion."""
        known = self._columns.get(joint)
        if known is None:
            linear, angular = self.joint_subspace(joint)
            rotation = self.joint_pose(joint).rotation
            known = (rotation @ linear, rotation @ angular)
            self._columns[joint] = known
        return known

    def support(self, joint: int) -> list[int]:
        """Joints from the root to ``joint``."""
        out = []
        while joint > 0:
            out.append(joint)
            joint = self.parents[joint]
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
            else:
                frame = self.model.frames[frame_index(self.model, name)]
                place = frame.placement
                known = (int(frame.parentJoint), Pose(rot.constant(place.rotation), rot.constant(place.translation)))
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
        chain = self._chain(joint)
        if chain is None:
            return ca.SX(6, self.nv)
        origins, linear, angular = chain
        moved = kernels.point_columns(origins.shape[1])(point, origins, linear, angular)
        both = ca.vertcat(moved, angular)
        blocks, start = [], 0
        for k in self.support(joint):
            width = self._width(k)
            blocks.append((k, both[:, start : start + width]))
            start += width
        return self.columns(6, blocks)

    @cached_property
    def screws(self) -> ca.SX:
        """6 x nv (linear at the origin of the world; angular), world axes: the twist of each degree of freedom.

        A body moves with the columns of the joints that it hangs on.
        """
        blocks = []
        for j in range(1, self.njoints):
            linear, angular = self.joint_twist(j)
            blocks.append((j, ca.vertcat(linear + rot.skew(self.joint_pose(j).position) @ angular, angular)))
        return self.columns(6, blocks)

    def _width(self, joint: int) -> int:
        return self.symbolic(joint).nv

    def _chain(self, joint: int) -> tuple[ca.SX, ca.SX, ca.SX] | None:
        """(origins, linear, angular), 3 x n each, world axes: the motion columns of every joint that moves a body."""
        known = self._chains.get(joint)
        if known is None and joint > 0:
            support = self.support(joint)
            origins = [ca.repmat(self.joint_pose(j).position, 1, self._width(j)) for j in support]
            linear, angular = zip(*map(self.joint_twist, support), strict=True)
            known = self._chains[joint] = ca.horzcat(*origins), ca.horzcat(*linear), ca.horzcat(*angular)
        return known

    def columns(self, rows: int, blocks: Iterable[tuple[int, ca.SX]]) -> ca.SX:
        """A rows x nv matrix from (joint, rows x nv_j) blocks; a mimic joint's block adds to its leader's."""
        placed: dict[int, ca.SX] = {}
        for joint, block in blocks:
            start = self._v_slices[joint].start
            placed[start] = placed[start] + block if start in placed else block
        parts, end = [], 0
        for start in sorted(placed):
            parts += [ca.SX(rows, start - end), placed[start]]
            end = start + placed[start].shape[1]
        return ca.sparsify(ca.horzcat(*parts, ca.SX(rows, self.nv - end)))

    @cached_property
    def _subtrees(self) -> list[tuple[float, ca.SX]]:
        """Per joint: mass of its subtree and the first moment of that mass, in the world."""
        masses = [0.0] * self.njoints
        moments = [ca.SX(3, 1) for _ in masses]
        for j in range(self.njoints - 1, 0, -1):
            inertia = self.model.inertias[j]
            if inertia.mass > 0.0:
                masses[j] += float(inertia.mass)
                moments[j] = moments[j] + inertia.mass * self.joint_pose(j).point(rot.constant(inertia.lever))
            parent = self.parents[j]
            masses[parent] += masses[j]
            moments[parent] = moments[parent] + moments[j]
        return list(zip(masses, moments, strict=True))

    def body_shares(self) -> list[tuple[int, float, ca.SX]]:
        """(joint, share of the robot's mass, first moment of that mass / all mass) of every body that has mass."""
        total = self.mass
        shares = []
        for j in range(1, self.njoints):
            inertia = self.model.inertias[j]
            if inertia.mass > 0.0:
                share = float(inertia.mass) / total
                shares.append((j, share, share * self.joint_pose(j).point(rot.constant(inertia.lever))))
        return shares

    @property
    def mass(self) -> float:
        """Mass of all moving bodies [kg]."""
        return self._subtrees[0][0]

    @cached_property
    def center_of_mass(self) -> ca.SX:
        """Centre of mass in the world [m], as Pinocchio's: bodies welded to the world do not count; 0 for no mass."""
        mass, moment = self._subtrees[0]
        return moment / mass if mass > 0.0 else ca.SX.zeros(3)

    @cached_property
    def center_of_mass_jacobian(self) -> ca.SX:
        """3 x nv Jacobian of :attr:`center_of_mass`: per joint, twist of the subtree's mass over all mass."""
        total = self._subtrees[0][0]
        blocks = []
        for j in range(1, self.njoints):
            mass, moment = self._subtrees[j]
            if mass > 0.0:
                linear, angular = self.joint_twist(j)
                arm = (moment - mass * self.joint_pose(j).position) / total
                blocks.append((j, (mass / total) * linear - rot.skew(arm) @ angular))
        return self.columns(3, blocks)

    @cached_property
    def tangent_map(self) -> ca.SX:
        """T(q), nq x nv, with dq/dt = T(q) v."""
        return self.tangent_map_at(self.q)

    def tangent_map_at(self, q: ca.SX) -> ca.SX:
        """T at another configuration."""
        blocks = [eye(at.stop - at.start) if maps is None else maps.tangent(q[at]) for maps, at, _ in self._manifolds]
        return ca.sparsify(ca.diagcat(*blocks)) if blocks else ca.SX(0, 0)

    def integrate(self, q: ca.SX, v: ca.SX) -> ca.SX:
        """q (+) v on the manifold (unit time)."""
        parts = [(maps, q[at], v[to]) for maps, at, to in self._manifolds]
        return ca.vertcat(*[a + b if maps is None else maps.integrate(a, b) for maps, a, b in parts])

    def difference(self, q0: ca.SX, q1: ca.SX, dofs: Sequence[int] | None = None) -> ca.SX:
        """v with q0 (+) v = q1, the shortest; ``dofs``: these numbers of it."""
        chosen = range(self.nv) if dofs is None else dofs
        parts = []
        for maps, at, to in self._manifolds:
            if not any(to.start <= k < to.stop for k in chosen):
                parts.append(ca.SX(to.stop - to.start, 1))
                continue
            first, last = q0[at], q1[at]
            parts.append(last - first if maps is None else maps.difference(first, last))
        whole = ca.vertcat(*parts)
        return whole if dofs is None else whole[list(dofs)]

    @cached_property
    def _manifolds(self) -> list[tuple[SymbolicJoint | None, slice, slice]]:
        """(maps, where in q, where in v) of joints that own coordinates, in the order of q; None: of joints that follow
        each other there and whose velocities are added, together.
        """
        out: list[tuple[SymbolicJoint | None, slice, slice]] = []
        own = [k for k in range(1, self.njoints) if k not in self.followers]
        for k in sorted(own, key=lambda k: self._q_slices[k].start):
            maps, at, to = self.symbolic(k), self._q_slices[k], self._v_slices[k]
            if not maps.added:
                out.append((maps, at, to))
                continue
            if out and out[-1][0] is None and (out[-1][1].stop, out[-1][2].stop) == (at.start, to.start):
                _, before, above = out.pop()
                at, to = slice(before.start, at.stop), slice(above.start, to.stop)
            out.append((None, at, to))
        return out

    def derivative(self, expression: ca.SX) -> ca.SX:
        """d f(q (+) dv) / d dv at dv = 0, rows x nv: df/dq T(q), exact on quaternions and unit circles.

        v and the other symbols in the expression are held.
        """
        return ca.sparsify(ca.jacobian(expression, self.q) @ self.tangent_map)

    def directional(self, expression: ca.SX, direction: ca.SX) -> ca.SX:
        """d f(q (+) t d) / dt at t = 0 for a direction d (nv): one sweep where :meth:`derivative` takes nv."""
        return ca.jtimes(expression, self.q, self.tangent_map @ direction)
