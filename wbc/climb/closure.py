"""Configurations in which given contacts are where they hold: the closed chains of a climber."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from wbc.climb.chain import ROWS
from wbc.climb.climber import Climber
from wbc.climb.joint_values import joint_values, with_joint_values
from wbc.climb.reach import LimbReach
from wbc.multibody import pin
from wbc.rotations import matrices
from wbc.validation import Array

#: Largest error of a contact after closing [m, rad]
CLOSED = 1e-9
#: Newton's steps at most: from an error of 0.1 m, convergence takes 4 to 6
STEPS = 12
#: A body that goes where it is asked to be: 1 rad of a joint weighs as much as this way of it [m, rad]
HEAVY_BODY = 0.03
#: A body that yields, as where limbs pass a singular posture [m, rad]
LIGHT_BODY = 0.3
#: What rounding may add to the squares of a step's rows
DAMPING = 1e-14


@dataclass(frozen=True, eq=False)
class Closure:
    """Newton's method on the contacts of a climber, with the least change of its joints and body.

        min ||S^-1 dz||  with  J Z dz = e,      q <- q (+) Z dz

    with J and e the fixed rows of the contacts' poses, z the angles of the limbs and the pose of the body, Z what
    couplings make of them, S 1 for angles and a length or angle for the body: one that is heavy goes where it was asked
    to be unless limbs cannot follow.
    """

    climber: Climber

    def closed(
        self, q: Array, contacts: Mapping[int, pin.SE3], body: float = HEAVY_BODY, turned: bool = True
    ) -> tuple[Array, float]:
        """The configuration near q with contact frames of limbs where they hold, and the largest error left [m, rad].

        Args:
            contacts: limb -> pose of its contact frame in the world; only the rows that its kind fixes count.
            body: way of the body that weighs as much as 1 rad of a joint [m, rad]; 0: it stays where it is.
            turned: whether rows of turns count; else only positions do.
        """
        out = np.array(q, dtype=np.float64)
        left = np.inf
        for step in range(STEPS + 1):
            rows, error = self._rows(out, contacts, body, turned)
            left = float(np.abs(error).max(initial=0.0))
            if left < CLOSED or step == STEPS or not np.isfinite(left) or left > 1e3:
                break
            square = rows @ rows.T
            square[np.diag_indices_from(square)] += DAMPING + 1e-12 * float(np.trace(square)) / len(square)
            moved = self._columns(body) @ (rows.T @ np.linalg.solve(square, error))
            # A step of more than a radian is beyond what the rows say
            moved *= min(1.0, 1.0 / max(float(np.abs(moved[6:]).max(initial=0.0)), 1e-9))
            out = pin.integrate(self._model, out, moved)
        return out, left

    def followed(self, limb: int, q: Array, poses: Array) -> bool:
        """Brings a limb's contact to poses in the world ``(n, 12)``, in some configurations ``(n, nq)`` and in place,
        the body as it is; whether that was found, or else nothing is changed.
        """
        if limb in self.short:
            return False
        root, wanted = self.climber.robot.model.jointPlacements[1], np.empty_like(poses)
        rotation = np.swapaxes(root.rotation @ matrices(q[:, 3:7]), 1, 2)
        wanted[:, :9] = (rotation @ poses[:, :9].reshape(-1, 3, 3)).reshape(-1, 9)
        away = poses[:, 9:] - q[:, :3] @ root.rotation.T - root.translation
        wanted[:, 9:] = np.einsum("nij,nj->ni", rotation, away)
        rows, values = self.climber.joints(limb) - 6, joint_values(self.climber.robot, q)
        angles, solved = self._reach.postures(limb, wanted, values[:, rows])
        if not solved.all():
            return False
        values[:, rows] = angles[:, 0]
        for coupling in self.climber.robot.couplings:
            values[:, coupling.follower - 6] = coupling.ratio * values[:, coupling.leader - 6] + coupling.offset
        q[:] = with_joint_values(self.climber.robot, q, values)
        return True

    @cached_property
    def short(self) -> frozenset[int]:
        """Limbs that fix more rows than they have joints."""
        limbs = range(len(self.climber.limbs))
        return frozenset(k for k in limbs if len(self.climber.joints(k)) < ROWS[self.climber.fixed(k)])

    def error(self, q: Array, contacts: Mapping[int, pin.SE3]) -> float:
        """Largest error of the fixed rows of contacts [m, rad]."""
        pin.forwardKinematics(self._model, self._data, np.asarray(q, dtype=np.float64))
        parts = [self._error(limb, target)[1] for limb, target in contacts.items()]
        return float(np.abs(np.concatenate(parts)).max()) if parts else 0.0

    def poses(self, q: Array) -> tuple[pin.SE3, ...]:
        """Pose in the world of every limb's contact frame."""
        pin.forwardKinematics(self._model, self._data, np.asarray(q, dtype=np.float64))
        return tuple(pin.SE3(pin.updateFramePlacement(self._model, self._data, f)) for f in self._frames)

    def _rows(self, q: Array, contacts: Mapping[int, pin.SE3], body: float, turned: bool) -> tuple[Array, Array]:
        model, data = self._model, self._data
        pin.computeJointJacobians(model, data, q)
        columns, blocks, errors = self._columns(body), [], []
        for limb, target in contacts.items():
            rows, error = self._error(limb, target, turned)
            jacobian = pin.getFrameJacobian(model, data, self._frames[limb], pin.ReferenceFrame.LOCAL)
            blocks.append(jacobian[rows])
            errors.append(error)
        if not blocks:
            return np.zeros((0, columns.shape[1])), np.zeros(0)
        return np.concatenate(blocks) @ columns, np.concatenate(errors)

    def _error(self, limb: int, target: pin.SE3, turned: bool = True) -> tuple[slice, Array]:
        """Rows of the contact's twist in its own frame, and what they have to change."""
        away = pin.updateFramePlacement(self._model, self._data, self._frames[limb]).actInv(target)
        fixed = self.climber.fixed(limb)
        if fixed == "position" or not turned:
            return slice(3), away.translation
        if fixed == "axis":
            z = away.rotation[:, 2]
            turn = np.array([-z[1], z[0]])
            if z[2] < 0.0:
                turn = turn / max(float(np.linalg.norm(turn)), 1e-9)
            return slice(5), np.concatenate([away.translation, turn])
        return slice(6), np.concatenate([away.translation, pin.log3(away.rotation)])

    def _columns(self, body: float) -> Array:
        """Z S, body first."""
        if body == 0.0:
            return self._angles
        out = np.zeros((len(self._angles), 6))
        out[:6] = body * np.eye(6)
        return np.hstack([out, self._angles])

    @cached_property
    def _reach(self) -> LimbReach:
        return LimbReach(self.climber, margin=0.0)

    @cached_property
    def _model(self) -> pin.Model:
        """The robot's, with a frame for each contact."""
        model = pin.Model(self.climber.robot.model)
        for limb in self.climber.limbs:
            tip = model.getFrameId(limb.frame)
            frame = model.frames[tip]
            place = frame.placement * limb.placement
            model.addFrame(pin.Frame(f"contact of {limb.name}", frame.parentJoint, tip, place, pin.FrameType.OP_FRAME))
        return model

    @cached_property
    def _frames(self) -> tuple[int, ...]:
        return tuple(self._model.getFrameId(f"contact of {limb.name}") for limb in self.climber.limbs)

    @cached_property
    def _data(self) -> pin.Data:
        return self._model.createData()

    @cached_property
    def _angles(self) -> Array:
        dofs = np.concatenate([self.climber.joints(limb) for limb in range(len(self.climber.limbs))])
        out = np.zeros((self.climber.robot.nv, len(dofs)))
        out[dofs, np.arange(len(dofs))] = 1.0
        for coupling in self.climber.robot.couplings:
            out[coupling.follower] = coupling.ratio * out[coupling.leader]
        return out
