"""Kinematics and dynamics of a tree as numbers, by Pinocchio's names.

All of it follows from the twists of bodies in the world. With J the twists at the world's origin of all degrees of
freedom, J_b those that body b hangs on (others 0), I_b its inertia about that origin, and V_b = J_b v:

    A_b = J_b a + sum_k V_k x J_k v_k - gravity      f_b = I_b A_b + V_b x* I_b V_b
    tau = sum_b J_b' f_b + armature a                M = sum_b J_b' I_b J_b + armature

Featherstone, Rigid Body Dynamics Algorithms, 2008, chapters 2 and 5.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from wbc.multibody.model import Model, ReferenceFrame, TreeData
from wbc.multibody.rotations import Array, skew, vector
from wbc.multibody.spatial import SE3, SpatialMotion


def neutral(model: Model) -> Array:
    """The configuration in which no joint turns or shifts [nq]."""
    return np.concatenate([np.zeros(0), *(joint.neutral for joint in model.joints[1:])])


def _split(model: Model, q: Array) -> list[Any]:
    return [(j, q[j.idx_q : j.idx_q + j.nq], slice(j.idx_v, j.idx_v + j.nv)) for j in model.joints[1:]]


def integrate(model: Model, q: Any, v: Any) -> Array:
    """q (+) v: the configuration after unit time at constant velocity [nq].

    Raises:
        ValueError: other counts of numbers.
    """
    start, step = vector(q, model.nq), vector(v, model.nv)
    if model.nq == model.nv and not any(joint.nq != joint.nv for joint in model.joints):
        return np.asarray(start + step)
    parts = [joint.integrate(own, step[dofs]) for joint, own, dofs in _split(model, start)]
    return np.concatenate([np.zeros(0), *parts])


def difference(model: Model, q: Any, later: Any) -> Array:
    """The least v with q (+) v = later [nv].

    Raises:
        ValueError: other counts of numbers.
    """
    start, end = vector(q, model.nq), vector(later, model.nq)
    parts = [joint.difference(own, end[joint.idx_q : joint.idx_q + joint.nq]) for joint, own, _ in _split(model, start)]
    return np.concatenate([np.zeros(0), *parts])


def interpolate(model: Model, q: Any, later: Any, share: float) -> Array:
    """q (+) share (later (-) q) [nq]."""
    return integrate(model, q, share * difference(model, q, later))


def normalize(model: Model, q: Any) -> Array:
    """q with quaternions and unit circles of unit length [nq]."""
    parts = [joint.normalize(own) for joint, own, _ in _split(model, vector(q, model.nq))]
    return np.concatenate([np.zeros(0), *parts])


def isNormalized(model: Model, q: Any, prec: float = 1e-12) -> bool:
    """Whether quaternions and unit circles have unit length: | |.| - 1 | <= prec."""
    return all(joint.unit_error(own) <= prec for joint, own, _ in _split(model, vector(q, model.nq)))


def forwardKinematics(model: Model, data: TreeData, q: Any, v: Any = None, a: Any = None) -> None:
    """Writes placements of joints; with v, and with a, twists and accelerations of bodies (gravity left out)."""
    at = vector(q, model.nq)
    for joint in model.joints[1:]:
        j, parent = joint.id, model.parents[joint.id]
        local = model.jointPlacements[j] * joint.placement(at[joint.idx_q : joint.idx_q + joint.nq])
        data.liMi[j].assign(local)
        data.oMi[j].assign(data.oMi[parent] * local if parent else local)
        if v is not None:
            dofs = slice(joint.idx_v, joint.idx_v + joint.nv)
            own = SpatialMotion(joint.S @ np.asarray(v, dtype=np.float64)[dofs])
            data.v[j].vector[:] = (local.actInv(data.v[parent]) + own).vector
            if a is not None:
                rate = SpatialMotion(joint.S @ np.asarray(a, dtype=np.float64)[dofs])
                data.a[j].vector[:] = (local.actInv(data.a[parent]) + rate + data.v[j].cross(own)).vector


def updateFramePlacement(model: Model, data: TreeData, number: int) -> SE3:
    """The placement of a frame in the world, from those of the joints; it is written, too."""
    frame = model.frames[number]
    data.oMf[number].assign(data.oMi[frame.parentJoint] * frame.placement)
    return data.oMf[number]


def updateFramePlacements(model: Model, data: TreeData) -> None:
    """Writes those of all frames."""
    for number in range(model.nframes):
        updateFramePlacement(model, data, number)


def framesForwardKinematics(model: Model, data: TreeData, q: Any) -> None:
    """Writes placements of joints and frames."""
    forwardKinematics(model, data, q)
    updateFramePlacements(model, data)


def computeJointJacobians(model: Model, data: TreeData, q: Any) -> Array:
    """J: twists at the world's origin, along its axes, of all degrees of freedom [6, nv]; writes placements, too."""
    forwardKinematics(model, data, q)
    for joint in model.joints[1:]:
        data.J[:, joint.idx_v : joint.idx_v + joint.nv] = data.oMi[joint.id].action @ joint.S
    return data.J


def _stated(columns: Array, pose: SE3, reference: int) -> Array:
    """Twists at the world's origin as seen from a pose."""
    if reference == ReferenceFrame.WORLD:
        return columns
    out = columns.copy()
    out[:3] += np.cross(columns[3:].T, pose.translation).T
    if reference == ReferenceFrame.LOCAL:
        out[:3], out[3:] = pose.rotation.T @ out[:3], pose.rotation.T @ out[3:]
    return out


def getJointJacobian(model: Model, data: TreeData, joint: int, reference: int) -> Array:
    """Of a joint's body, from what :func:`computeJointJacobians` wrote [6, nv]."""
    return _stated(data.J * data.moved_by[joint], data.oMi[joint], reference)


def getFrameJacobian(model: Model, data: TreeData, number: int, reference: int) -> Array:
    """Of a frame, from what :func:`computeJointJacobians` wrote [6, nv]."""
    joint = model.frames[number].parentJoint
    return _stated(data.J * data.moved_by[joint], updateFramePlacement(model, data, number), reference)


def computeFrameJacobian(
    model: Model, data: TreeData, q: Any, number: int, reference: int = ReferenceFrame.LOCAL
) -> Array:
    """Of a frame at q [6, nv]."""
    computeJointJacobians(model, data, q)
    return getFrameJacobian(model, data, number, reference)


def _of_frame(motion: SpatialMotion, model: Model, data: TreeData, number: int, reference: int) -> SpatialMotion:
    """A twist of a joint's body in its own axes, stated at a frame."""
    frame = model.frames[number]
    out: SpatialMotion = frame.placement.actInv(motion)
    if reference == ReferenceFrame.LOCAL:
        return out
    pose = updateFramePlacement(model, data, number)
    if reference == ReferenceFrame.WORLD:
        world: SpatialMotion = pose.act(out)
        return world
    return SpatialMotion(pose.rotation @ out.linear, pose.rotation @ out.angular)


def getFrameVelocity(model: Model, data: TreeData, number: int, reference: int = ReferenceFrame.LOCAL) -> SpatialMotion:
    """The twist of a frame, from what :func:`forwardKinematics` wrote."""
    return _of_frame(data.v[model.frames[number].parentJoint], model, data, number, reference)


def getFrameAcceleration(
    model: Model, data: TreeData, number: int, reference: int = ReferenceFrame.LOCAL
) -> SpatialMotion:
    """The rate of a frame's twist, from what :func:`forwardKinematics` wrote."""
    return _of_frame(data.a[model.frames[number].parentJoint], model, data, number, reference)


def getFrameClassicalAcceleration(
    model: Model, data: TreeData, number: int, reference: int = ReferenceFrame.LOCAL
) -> SpatialMotion:
    """The acceleration of a frame's origin, dv/dt + w x v, and of its turn."""
    out = getFrameAcceleration(model, data, number, reference)
    speed = getFrameVelocity(model, data, number, reference)
    return SpatialMotion(out.linear + np.cross(speed.angular, speed.linear), out.angular)


class _BodyTwists:
    """Twists [bodies, 6, nv] and inertias [bodies, 6, 6] of all bodies about the world's origin."""

    def __init__(self, model: Model, data: TreeData, q: Any) -> None:
        self.model, self.columns = model, computeJointJacobians(model, data, q)
        self.masks = data.moved_by[1:, None, :]
        self.jacobians = self.columns[None] * self.masks
        inertias = [data.oMi[j].act(model.inertias[j]).matrix() for j in range(1, model.njoints)]
        self.inertias = np.array(inertias).reshape(-1, 6, 6)

    def gathered(self, per_body: Array) -> Array:
        """sum_b J_b' x_b."""
        return np.tensordot(self.jacobians, per_body, axes=((0, 1), (0, 1)))

    def rates(self, crossings: Array) -> Array:
        """dJ/dt, by body, of crossings V_b x: J_k' = V_k x J_k, as axes are constant on the child side of a joint."""
        out = np.zeros_like(self.columns)
        for joint in self.model.joints[1:]:
            dofs = slice(joint.idx_v, joint.idx_v + joint.nv)
            out[:, dofs] = crossings[joint.id - 1] @ self.columns[:, dofs]
        return out[None] * self.masks

    def mass_matrix(self) -> Array:
        """M [nv, nv]."""
        out = self.gathered(self.inertias @ self.jacobians)
        return np.asarray(0.5 * (out + out.T) + np.diag(self.model.armature))

    def crossings(self, v: Array) -> Array:
        """V_b x of the twists at a velocity [bodies, 6, 6]."""
        return np.array([_crossing(twist) for twist in self.jacobians @ v]).reshape(-1, 6, 6)

    def torques(self, v: Array, a: Array, gravity: Array) -> Array:
        """tau [nv]."""
        accelerations = self.jacobians @ a - gravity
        forces = np.einsum("bij,bj->bi", self.inertias, accelerations)
        if v.any():
            crossings, twists = self.crossings(v), self.jacobians @ v
            forces += np.einsum("bij,bj->bi", self.inertias, self.rates(crossings) @ v)
            momenta = np.einsum("bij,bj->bi", self.inertias, twists)
            forces -= np.einsum("bji,bj->bi", crossings, momenta)
        return np.asarray(self.gathered(forces) + self.model.armature * a)


def _crossing(twist: Array) -> Array:
    """The matrix of V x; that of V x* is minus its transpose."""
    out = np.zeros((6, 6))
    out[:3, :3] = out[3:, 3:] = skew(twist[3:])
    out[:3, 3:] = skew(twist[:3])
    return out


def rnea(model: Model, data: TreeData, q: Any, v: Any, a: Any) -> Array:
    """The torques of an acceleration [nv].

    Raises:
        ValueError: other counts of numbers.
    """
    speeds, rates = vector(v, model.nv), vector(a, model.nv)
    return _BodyTwists(model, data, q).torques(speeds, rates, model.gravity.vector)


def nonLinearEffects(model: Model, data: TreeData, q: Any, v: Any) -> Array:
    """b(q, v) + g(q): the torques of no acceleration [nv]."""
    return rnea(model, data, q, v, np.zeros(model.nv))


def computeGeneralizedGravity(model: Model, data: TreeData, q: Any) -> Array:
    """g(q): the torques at rest [nv]."""
    return nonLinearEffects(model, data, q, np.zeros(model.nv))


def crba(model: Model, data: TreeData, q: Any, convention: Any = None) -> Array:
    """The mass matrix, both halves [nv, nv]."""
    data.M = _BodyTwists(model, data, q).mass_matrix()
    return data.M


def aba(model: Model, data: TreeData, q: Any, v: Any, tau: Any) -> Array:
    """The acceleration of torques: M a = tau - b - g [nv]."""
    bodies, still = _BodyTwists(model, data, q), np.zeros(model.nv)
    rest = bodies.torques(vector(v, model.nv), still, model.gravity.vector)
    return np.asarray(np.linalg.solve(bodies.mass_matrix(), vector(tau, model.nv) - rest))


def computeCoriolisMatrix(model: Model, data: TreeData, q: Any, v: Any) -> Array:
    """C with C v = b(q, v) and dM/dt = C + C' [nv, nv]: sum_b J_b' (I_b dJ_b/dt + B_b J_b) with

        B_b = 1/2 (V_b x* I_b - I_b V_b x + [I_b V_b x])

    the last the matrix of y to y x* I_b V_b (Echeandia and Wensing 2021).
    """
    bodies, speeds = _BodyTwists(model, data, q), vector(v, model.nv)
    crossings = bodies.crossings(speeds)
    forces = bodies.inertias @ bodies.rates(crossings)
    for b, twist in enumerate(bodies.jacobians @ speeds):
        inertia, across = bodies.inertias[b], crossings[b]
        momentum = inertia @ twist
        turned = np.zeros((6, 6))
        turned[:3, 3:] = turned[3:, :3] = -skew(momentum[:3])
        turned[3:, 3:] = -skew(momentum[3:])
        forces[b] += 0.5 * (turned - across.T @ inertia - inertia @ across) @ bodies.jacobians[b]
    return bodies.gathered(forces)


def computeTotalMass(model: Model, data: TreeData | None = None) -> float:
    """Of all bodies that joints carry [kg]."""
    return float(sum(inertia.mass for inertia in model.inertias[1:]))


def centerOfMass(model: Model, data: TreeData, q: Any, v: Any = None) -> Array:
    """Of all bodies that joints carry [m]; with v its velocity is written, too; 0 for no mass."""
    forwardKinematics(model, data, q)
    moments = [model.inertias[j].mass * data.oMi[j].act(model.inertias[j].lever) for j in range(1, model.njoints)]
    data.mass[0] = computeTotalMass(model)
    data.com[0][:] = np.sum(moments, axis=0) / data.mass[0] if data.mass[0] > 0.0 else 0.0
    if v is not None:
        data.vcom[0][:] = jacobianCenterOfMass(model, data, q) @ vector(v, model.nv)
    return data.com[0]


def _momentum_map(model: Model, data: TreeData, q: Any) -> Array:
    """Momentum about the centre of mass, along the world's axes, of each degree of freedom [6, nv]."""
    bodies = _BodyTwists(model, data, q)
    about_origin = (bodies.inertias @ bodies.jacobians).sum(axis=0)
    center = centerOfMass(model, data, q)
    about_origin[3:] -= skew(center) @ about_origin[:3]
    return np.asarray(about_origin)


def jacobianCenterOfMass(model: Model, data: TreeData, q: Any) -> Array:
    """d com / d q [3, nv]."""
    return np.asarray(_momentum_map(model, data, q)[:3] / computeTotalMass(model))


def computeCentroidalMap(model: Model, data: TreeData, q: Any) -> Array:
    """A with the momentum about the centre of mass = A v [6, nv]."""
    return _momentum_map(model, data, q)


def computeCentroidalMomentum(model: Model, data: TreeData, q: Any, v: Any) -> SpatialMotion:
    """The momentum about the centre of mass, along the world's axes [N s; N m s]."""
    data.hg = SpatialMotion(_momentum_map(model, data, q) @ vector(v, model.nv))
    return data.hg


def computePotentialEnergy(model: Model, data: TreeData, q: Any) -> float:
    """- m gravity . com [J]."""
    return float(-computeTotalMass(model) * (model.gravity.linear @ centerOfMass(model, data, q)))
