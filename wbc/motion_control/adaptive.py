"""Passivity-based adaptive control: what is not known of some bodies is learned while the motion is followed.

    v_r = v_d + lambda e,  a_r = dv_r/dt,  s = v_r - v,  e = q_d (-) q
    tau = Y(q, v, v_r, a_r + k s) phi             = M (a_r + k s) + C(q, v) v_r + g with the estimate's inertias
    dP/dt = gamma S (Y's + beta (b - Lambda phi) / k) S,   P > 0              of every learned body
    Lambda = int Y'M^-1 Y dt,  b = int Y'M^-1 tau dt                     Y at the measured state and acceleration

With the true inertias e dies away with rates lambda and k; else V = s'M s / 2 + |P - P_true|^2 / (2 gamma) in the
metric of S never grows, as M' - 2 C is skew: dV/dt = -k s'M s - |phi - phi_true|^2 in the metric of beta Lambda / k.
P is a body's pseudo-inertia and S the size of what is not known of it; the bracket of 10 numbers stands for a symmetric
4 x 4 matrix. An estimate that would leave the bodies is projected, which only lowers V. A floating base without motors
has a reference velocity of its own, whose rate is the one that needs no force there.

Source: Slotine and Li 1987; S and P: Lee, Kwon and Park 2018, A natural adaptive control law for robot manipulators
(with a constant metric); Lambda: Chowdhary and Johnson 2010, Concurrent learning; moving bases: Niemeyer and Slotine
1991, Wang and Xie 2012.
"""

from __future__ import annotations

from collections.abc import Sequence

import casadi as ca
import numpy as np
from scipy.linalg import block_diag

from wbc import validation
from wbc.errors import RangeError
from wbc.identification.information import Information
from wbc.identification.pseudo_inertia import model_parameters, nearest_body, parameters, pseudo_inertia
from wbc.motion_control.motion import Motion, checked_dynamics, checked_gains, checked_motion, measured
from wbc.multibody import mass_matrix, pin
from wbc.native.compiled_function import compiled
from wbc.robot import Robot
from wbc.symbolic import Kinematics, TwoVelocityDynamics
from wbc.symbolic.evaluation import SingleState
from wbc.symbolic.two_velocities import PER_BODY
from wbc.validation import Array

#: Part of the robot's mass that an unknown load is expected to have at most
LOAD = 0.1
#: Part of the robot's characteristic length at which an unknown load is expected at most
REACH = 0.1
#: An estimate keeps this part of S in every direction, so that its mass matrix is regular
LEAST = 1e-4
#: Samples of the motion at which its largest gain is looked for
SAMPLES = 20
#: Time over which they are spread [s]
HORIZON = 2.0
#: Torques and accelerations are averaged over this time before they are compared, as velocities are noisy [s]
WINDOW = 0.05
#: How much the past counts beside the error of now, beta: what noise of encoders of 1e-5 bears
PAST = 1e4


class AdaptiveControl:
    """Follows a motion and learns the ten parameters of chosen bodies.

    Args:
        robot: the model that is believed at first. motion: what to follow. dt: step [s].
        stiffness: lambda [1/s]. damping: k [1/s]. Both poles of the error.
        learn: joints whose bodies are learned; default: the last one's.
        rate: how quickly, as a part in (0, 1] of the gain at which estimate and error swing: it sets gamma.
        memory: how long torques are remembered [s], a time constant: short where loads change; 0: not at all.
        torque_noise: what the torques are not trusted below, a standard deviation of each [N m or N] over one
            second: it decides what the estimate may claim.

    Attributes:
        information: what the motion has shown so far of the learned parameters.

    Raises:
        RangeError: gains or a step with which the error does not die away; negative masses, a singular mass matrix.
        UnsupportedJointError: a base that is neither fixed nor floating, coupled joints.
        UnknownNameError: no such joint. ShapeError, NotFiniteError, RotationError: a motion of another robot.
    """

    def __init__(
        self,
        robot: Robot,
        motion: Motion,
        dt: float,
        *,
        stiffness: float,
        damping: float,
        learn: Sequence[str] | None = None,
        rate: float = 0.5,
        memory: float = float("inf"),
        torque_noise: float = 0.05,
    ) -> None:
        self.motion = checked_motion(robot, motion)
        self._robot = checked_dynamics(robot, motion(0.0)[0])
        names = (robot.joint_names[-1],) if learn is None else validation.strings("learn", learn)
        self.learn = tuple(validation.one_of("learn", name, robot.joint_names) for name in names)
        self.stiffness, self.damping = stiffness, damping
        self.dt = checked_gains(stiffness * damping, stiffness + damping, dt)[2]
        self._model, self._data = robot.model, robot.model.createData()
        self._base, self._base_rate = robot.base_nv, np.zeros(robot.base_nv)
        self._started = False
        self._places = [PER_BODY * (int(robot.model.getJointId(name)) - 1) for name in self.learn]
        self._phi = model_parameters(robot.model)
        self._known = self._phi.copy()
        self._scales = [self._scale(at) for at in self._places]
        self._pseudo = [nearest_body(pseudo_inertia(self._body(at)), S, LEAST) for at, S in self._each()]
        self._basis = block_diag(*[_metric_basis(S) for S in self._scales])
        self._law, self._regressor = self._functions()
        if memory != float("inf"):
            memory = validation.scalar("memory", memory, low=0.0, unit="s")
        self._past = TorqueHistory(PER_BODY * len(self.learn), memory)
        self.information = Information(
            PER_BODY * len(self.learn), validation.scalar("torque_noise", torque_noise, low=0.0, open_low=True)
        )
        self.gamma = validation.scalar("rate", rate, low=0.0, high=1.0, open_low=True) * self._largest_gain()
        self._write()

    def command(self, time: float, q: Array, v: Array) -> Array:
        """Torques ``[nv]``, 0 for a floating base; the estimate moves on by one step.

        Raises:
            ShapeError, NotFiniteError, RangeError, RotationError: no measurement.
        """
        q, v = measured(self._robot, q, v)
        wanted, rate, acceleration = self.motion(time)
        e = pin.difference(self._model, q, wanted)
        reference, base = rate + self.stiffness * e, self._base
        if not self._started:
            self._started, self._base_rate = True, v[:base].copy()
        else:
            self._remember(q, v)
        reference[:base] = self._base_rate
        s = reference - v
        a = acceleration + self.stiffness * (rate - v) + self.damping * s
        law = self._law
        for array, values in zip(law.inputs, (q, v, reference, a, s, self._phi), strict=True):
            array[:] = values
        if base:
            # With no acceleration of the base first: what is left there is linear in it
            law.inputs[3][:base] = 0.0
            law.run()
            M = law.output[-base * base :].reshape(base, base)
            a[:base] = -np.linalg.solve(M, law.output[:base])
            law.inputs[3][:base] = a[:base]
            self._base_rate = self._base_rate + self.dt * (a[:base] - self.damping * s[:base])
        law.run()
        nv, count = self._model.nv, PER_BODY * len(self.learn)
        torque = law.output[:nv].copy()
        torque[:base] = 0.0
        self._adapt(law.output[nv : nv + count])
        self.information.add(self._shown_at(wanted, rate, acceleration), self.dt)
        self._last = q, v, torque
        return np.asarray(torque)

    def _remember(self, q: Array, v: Array) -> None:
        """Compare the torques of the last step with what the estimate needs for how it ended."""
        if self._past.memory == 0.0:
            return
        before, speed, torque = self._last
        middle = pin.integrate(self._model, before, 0.5 * pin.difference(self._model, before, q))
        mean, a = (speed + v) / 2.0, (v - speed) / self.dt
        Y = self._shown_at(middle, mean, a)
        for array, values in zip(self._law.inputs, (middle, mean, mean, a, 0.0, self._phi), strict=True):
            array[:] = values
        self._law.run()
        missing = torque - self._law.output[: self._model.nv] + Y @ self._learned()
        self._past.add(Y, missing, self.dt)
        if self._past.time >= WINDOW:
            self._past.close(np.asarray(np.linalg.inv(mass_matrix(self._model, self._data, q)), dtype=np.float64))

    def _learned(self) -> Array:
        return np.concatenate([self._body(at) for at in self._places])

    def body(self, joint: str) -> Array:
        """The estimate of a learned body, ten numbers as ``pin.Inertia.toDynamicParameters``.

        Raises:
            UnknownNameError: it is not learned.
        """
        return self._body(self._places[self.learn.index(validation.one_of("joint", joint, self.learn))]).copy()

    def unknown(self, joint: str) -> Array:
        """What was learned of a body besides the model's: the payload, ten numbers."""
        at = self._places[self.learn.index(validation.one_of("joint", joint, self.learn))]
        return self._body(at) - self._known[at : at + PER_BODY]

    def mass(self, joint: str) -> tuple[float, float]:
        """(mass besides the model's, its least standard deviation by what the motion has shown) [kg].

        Raises:
            UnknownNameError: it is not learned.
        """
        k = self.learn.index(validation.one_of("joint", joint, self.learn))
        weights = np.zeros(PER_BODY * len(self.learn))
        weights[PER_BODY * k] = 1.0
        return float(self.unknown(joint)[0]), self.information.deviation(weights)

    def _each(self) -> list[tuple[int, Array]]:
        return list(zip(self._places, self._scales, strict=True))

    def _body(self, at: int) -> Array:
        return self._phi[at : at + PER_BODY]

    def _scale(self, at: int) -> Array:
        """S of a body: its own inertia, and a load of the robot's size about its joint."""
        mass = LOAD * sum(body.mass for body in self._model.inertias)
        radius = REACH * self._robot.characteristic_length
        load = mass * np.diag([radius**2, radius**2, radius**2, 1.0])
        own = pseudo_inertia(self._phi[at : at + PER_BODY])
        return np.asarray(nearest_body(own, load, 0.0) + load)

    def _functions(self) -> tuple[SingleState, SingleState]:
        """Torques, the learned part of Y's and M of the base; and the learned part of Y."""
        kin = Kinematics(self._model)
        dynamics, s, base = TwoVelocityDynamics(kin), ca.SX.sym("s", kin.nv), self._base
        given = [kin.q, kin.v, dynamics.reference, dynamics.acceleration]
        learned = ca.vertcat(*[dynamics.parameters[at : at + PER_BODY] for at in self._places])
        slope = ca.gradient(ca.dot(s, dynamics.torques), learned)
        M = ca.jacobian(dynamics.torques[:base], dynamics.acceleration[:base])
        law = ca.densify(ca.vertcat(dynamics.torques, slope, ca.vec(M)))
        regressor = ca.densify(ca.vec(ca.jacobian(dynamics.torques, learned)))
        return (
            SingleState(compiled(ca.Function("law", [*given, s, dynamics.parameters], [law]))),
            SingleState(compiled(ca.Function("regressor", given, [regressor]))),
        )

    def _shown_at(self, q: Array, v: Array, a: Array) -> Array:
        """Y of the learned parameters at a state of the motion itself: noise of measurements shows nothing."""
        for array, values in zip(self._regressor.inputs, (q, v, v, a), strict=True):
            array[:] = values
        self._regressor.run()
        return self._regressor.output.reshape(-1, self._model.nv).T

    def _largest_gain(self) -> float:
        """gamma at which the slowest pair of error and estimate is critically damped along the motion's first part."""
        worst, data = 0.0, self._model.createData()
        for time in np.linspace(0.0, HORIZON, SAMPLES):
            q, v, a = self.motion(float(time))
            Z = self._shown_at(q, v, a) @ self._basis
            worst = max(
                worst, float(np.linalg.eigvalsh(Z.T @ np.linalg.solve(mass_matrix(self._model, data, q), Z))[-1])
            )
        if worst == 0.0:
            raise RangeError("learn", self.learn, "the motion needs no torque for these bodies: nothing can be learned")
        return self.damping**2 / 4.0 / worst

    def _adapt(self, slope: Array) -> None:
        """An implicit step of the estimates, in the coordinates of an orthonormal basis in the metric of S."""
        B, past, weight, pace = self._basis, self._past, PAST / self.damping, self.dt * self.gamma
        here = B.T @ (slope + weight * (past.b - past.information @ self._learned()))
        implicit = np.eye(len(here)) + pace * weight * B.T @ past.information @ B
        change = (B @ np.linalg.solve(implicit, pace * here)).reshape(-1, PER_BODY)
        for k, (S, own) in enumerate(zip(self._scales, change, strict=True)):
            self._pseudo[k] = nearest_body(self._pseudo[k] + pseudo_inertia(own), S, LEAST)
        self._write()

    def _write(self) -> None:
        for at, P in zip(self._places, self._pseudo, strict=True):
            self._phi[at : at + PER_BODY] = parameters(P)


class TorqueHistory:
    """Torques that acted, gathered over windows of time: Lambda and b."""

    def __init__(self, count: int, memory: float) -> None:
        self.memory, self.time = memory, 0.0
        self.information, self.b = np.zeros((count, count)), np.zeros(count)
        self._Y: Array | float = 0.0
        self._torque: Array | float = 0.0

    def add(self, Y: Array, torque: Array, dt: float) -> None:
        """torque = Y phi over a step."""
        self._Y, self._torque, self.time = self._Y + dt * Y, self._torque + dt * torque, self.time + dt

    def close(self, weight: Array) -> None:
        """Take on the mean of a window."""
        Y, torque = np.asarray(self._Y), np.asarray(self._torque)
        left = np.exp(-self.time / self.memory)
        self.information = left * self.information + Y.T @ weight @ Y / self.time
        self.b = left * self.b + Y.T @ weight @ torque / self.time
        self._Y, self._torque, self.time = 0.0, 0.0, 0.0


def _metric_basis(S: Array) -> Array:
    """[10, 10]: parameters of symmetric matrices that are orthonormal in the metric of S."""
    G, columns = np.linalg.cholesky(S), []
    for i in range(4):
        for j in range(i, 4):
            E = np.zeros((4, 4))
            E[i, j] = E[j, i] = 1.0 if i == j else np.sqrt(0.5)
            columns.append(parameters(G @ E @ G.T))
    return np.array(columns).T
