"""Pinocchio's answers for every quantity that ``wbc.symbolic`` builds, and how far ours are from them."""

from __future__ import annotations

import zlib
from collections.abc import Callable
from functools import cached_property

import casadi as ca
import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from wbc.robot.sources.files import example_data_folder
from wbc.symbolic import Centroidal, Dynamics, Kinematics, Velocities
from wbc.symbolic.kinematics import WORLD, frame_index

Array = NDArray[np.float64]

#: Largest error, of each quantity on each robot, in the norm of :func:`distance`.
TOLERANCE = 1e-10

REFERENCES = {"world_aligned": pin.LOCAL_WORLD_ALIGNED, "local": pin.LOCAL, "world": pin.WORLD}

DESCRIPTIONS = example_data_folder()
#: The one file of the wheel that does not parse: it names no robot.
BROKEN = "ur_description/urdf/ur3.urdf"
FILES = tuple(
    sorted(name for f in DESCRIPTIONS.rglob("*.urdf") if (name := f.relative_to(DESCRIPTIONS).as_posix()) != BROKEN)
)

BASES: dict[str, Callable[[], pin.JointModel] | None] = {
    "fixed": None,
    "floating": pin.JointModelFreeFlyer,
    "planar": pin.JointModelPlanar,
}


def load(file: str, base: str = "fixed") -> pin.Model:
    """A model of the wheel on one of :data:`BASES`."""
    joint = BASES[base]
    return pin.buildModelFromUrdf(str(DESCRIPTIONS / file), *(() if joint is None else (joint(),)))


def distance(ours: Array, theirs: Array) -> float:
    """max |ours - theirs| / max(1, max |theirs|); infinite for a NaN."""
    if theirs.size == 0:
        return 0.0
    ours = np.reshape(ours, theirs.shape)
    gap = np.abs(ours - theirs).max() / max(1.0, float(np.abs(theirs).max()))
    return float(gap) if np.isfinite(gap) else float("inf")


def random_state(model: pin.Model, seed: str) -> tuple[Array, Array, Array]:
    """(q, v, a): a configuration anywhere on the manifold, velocities and accelerations of order 1."""
    rng = np.random.default_rng(zlib.crc32(seed.encode()))
    q = pin.integrate(model, pin.neutral(model), rng.uniform(-3.0, 3.0, model.nv))
    return np.array(q), rng.normal(size=model.nv), rng.normal(size=model.nv)


class Comparison:
    """Named pairs (our expression, Pinocchio's value) of one model at one random state."""

    def __init__(self, model: pin.Model, seed: str = "") -> None:
        self.model, self.data = model, model.createData()
        self.kinematics = Kinematics(model)
        self.motion = Velocities(self.kinematics)
        self.dynamics = Dynamics(self.kinematics, self.motion)
        self.centroidal = Centroidal(self.dynamics)
        self.q, self.v, self.a = random_state(model, f"{model.name} {model.nv} {seed}")
        self.direction = ca.SX.sym("direction", model.nv)
        self.pairs: dict[str, tuple[ca.SX, Array]] = {}

    def add(self, name: str, ours: ca.SX, theirs: object) -> None:
        self.pairs[name] = (ours, np.array(theirs, dtype=float))

    @cached_property
    def frames(self) -> list[int]:
        """Up to three frames spread over the list, the last one included."""
        named = self.named
        return [named[int(k)] for k in sorted(set(np.linspace(0, len(named) - 1, 4)[1:].astype(int)))]

    @cached_property
    def named(self) -> list[int]:
        """Frames that their name means; a link called ``world`` is not one, as that name is the fixed root's."""
        frames = list(self.model.frames)
        return [i for i, f in enumerate(frames) if f.name != WORLD and frame_index(self.model, f.name) == i]

    def errors(self) -> dict[str, float]:
        """Distance per quantity."""
        kin = self.kinematics
        names = list(self.pairs)
        function = ca.Function(
            "ours", [kin.q, kin.v, self.dynamics.a, self.direction], [self.pairs[n][0] for n in names]
        )
        values = function.call([self.q, self.v, self.a, self._direction])
        return {n: distance(v.full(), self.pairs[n][1]) for n, v in zip(names, values, strict=True)}

    @cached_property
    def _direction(self) -> Array:
        return np.random.default_rng(7).normal(size=self.model.nv)

    def check(self) -> None:
        wrong = {name: error for name, error in self.errors().items() if error > TOLERANCE}
        assert wrong == {}

    def poses(self) -> None:
        """Every frame's pose."""
        pin.framesForwardKinematics(self.model, self.data, self.q)
        ours, theirs = [], []
        for i in self.named:
            pose = self.kinematics.pose(self.model.frames[i].name)
            ours += [pose.rotation, pose.position]
            theirs += [self.data.oMf[i].rotation, self.data.oMf[i].translation.reshape(3, 1)]
        self.add("poses", ca.horzcat(*ours), np.hstack(theirs))

    def frame_motion(self, *, constant_subspaces: bool = True) -> None:
        """Jacobians, velocities, both bias accelerations and Jacobian drift in the three references.

        Pinocchio's rate of the Jacobian leaves out dS/dt, so it judges only joints of constant motion subspaces.
        """
        model, data, motion = self.model, self.data, self.motion
        pin.computeJointJacobiansTimeVariation(model, data, self.q, self.v)
        pin.forwardKinematics(model, data, self.q, self.v, np.zeros(model.nv))
        pin.updateFramePlacements(model, data)
        for i in self.frames:
            frame = model.frames[i].name
            for ours, theirs in REFERENCES.items():
                label = f"{frame} {ours}"
                self.add(
                    f"J {label}", self.kinematics.jacobian(frame, ours), pin.getFrameJacobian(model, data, i, theirs)
                )
                self.add(
                    f"twist {label}", motion.frame_velocity(frame, ours), pin.getFrameVelocity(model, data, i, theirs)
                )
                spatial = pin.getFrameAcceleration(model, data, i, theirs)
                self.add(f"spatial {label}", motion.bias_acceleration(frame, ours, "spatial"), spatial)
                classical = pin.getFrameClassicalAcceleration(model, data, i, theirs)
                self.add(f"classical {label}", motion.bias_acceleration(frame, ours), classical)
                if constant_subspaces:
                    rate = pin.getFrameJacobianTimeVariation(model, data, i, theirs)
                    self.add(f"drift {label}", motion.jacobian_drift(frame, ours), rate @ self.v)

    def center(self) -> None:
        """Centre of mass and centroidal momentum."""
        model, data, parts = self.model, self.data, self.centroidal
        zero = np.zeros(model.nv)
        pin.centerOfMass(model, data, self.q, self.v, zero)
        self.add("com", self.kinematics.center_of_mass, data.com[0])
        self.add("com velocity", parts.center_of_mass_velocity, data.vcom[0])
        self.add("com drift", parts.center_of_mass_drift, data.acom[0])
        self.add("com J", self.kinematics.center_of_mass_jacobian, pin.jacobianCenterOfMass(model, data, self.q))
        pin.computeCentroidalMap(model, data, self.q)
        self.add("A_g", parts.matrix, data.Ag)
        pin.computeCentroidalMomentumTimeVariation(model, data, self.q, self.v, zero)
        self.add("momentum", parts.momentum, data.hg.vector)
        self.add("momentum drift", parts.drift, data.dhg.vector)

    def forces(self) -> None:
        """Inverse dynamics, its parts, mass matrix and kinetic energy."""
        model, data, dynamics = self.model, self.data, self.dynamics
        self.add("inverse dynamics", dynamics.inverse_dynamics, pin.rnea(model, data, self.q, self.v, self.a))
        self.add("nonlinear", dynamics.nonlinear_effects, pin.nonLinearEffects(model, data, self.q, self.v))
        self.add("gravity", dynamics.gravity, pin.computeGeneralizedGravity(model, data, self.q))
        mass = pin.crba(model, data, self.q)
        self.add("mass matrix", dynamics.mass_matrix, mass)
        self.add("kinetic energy", dynamics.kinetic_energy, 0.5 * self.v @ mass @ self.v)
        # With armature, pin 4.1.0 disagrees with its own mass matrix on unaligned joints; for mimic joints it has none
        if not model.armature.any() and not len(model.mimicking_joints):
            energy = pin.computeKineticEnergy(model, data, self.q, self.v)
            self.add("kinetic energy, summed", dynamics.kinetic_energy, energy)

    def torque_derivatives(self, *, full: bool) -> None:
        """d tau/dq and d tau/dv, whole or along one direction of the tangent space."""
        kin, tau = self.kinematics, self.dynamics.inverse_dynamics
        pin.computeRNEADerivatives(self.model, self.data, self.q, self.v, self.a)
        by_q, by_v = np.array(self.data.dtau_dq), np.array(self.data.dtau_dv)
        if full:
            ours_q, ours_v = self.dynamics.inverse_dynamics_derivatives
            self.add("d tau/dq", ours_q, by_q)
            self.add("d tau/dv", ours_v, by_v)
            return
        self.add("d tau/dq along", kin.directional(tau, self.direction), by_q @ self._direction)
        self.add("d tau/dv along", ca.jtimes(tau, kin.v, self.direction), by_v @ self._direction)

    def manifold(self) -> None:
        """q (+) v and the difference back."""
        kin, moved = self.kinematics, pin.integrate(self.model, self.q, 0.5 * self.v)
        self.add("integrate", kin.integrate(kin.q, 0.5 * kin.v), moved)
        ours = kin.difference(kin.q, kin.integrate(kin.q, 0.5 * kin.v))
        self.add("difference", ours, pin.difference(self.model, self.q, moved))
