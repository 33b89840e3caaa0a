"""Accelerations of a tree of bodies of which some frames are held, by Pinocchio, and steps in time."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np

from wbc.multibody import pin
from wbc.simulation.plant import GripKind
from wbc.validation import Array

Integrator = Literal["rk4", "midpoint"]
#: Distance of the two points that hold an axis [m]
AXIS = 0.1
#: Proximal parameter
PROXIMAL = 1e-8
#: Iterations: rows that say the same twice, as those of an axis do, need a second one
ITERATIONS = 2
#: Joints whose displacements do not commute: a pose, a turn in space, a pose in the plane
TURNING = {"JointModelFreeFlyer": 6, "JointModelSpherical": 3, "JointModelPlanar": 2}


@dataclass(frozen=True, eq=False)
class Grip:
    """A frame that is held at a pose of the world; see :class:`GripKind` for what of it is."""

    pose: pin.SE3
    kind: GripKind


@dataclass(frozen=True, eq=False)
class Slip:
    """A grip that slips, by ``velocity`` in the mean over ``duration`` T [m/s, s]. As friction leaves a hand no more
    than a share of what pulls at it, it speeds up and slows down: v(t) = velocity (1 - cos(2 pi t / T)).

    Attributes:
        time: since it began [s].
    """

    velocity: Array
    duration: float
    time: float = 0.0

    def on(self, h: float) -> tuple[Array, Slip | None]:
        """How far it goes in the next h [m, s], and what is left of it."""
        then = min(self.time + h, self.duration)
        left = None if then >= self.duration else Slip(self.velocity, self.duration, then)
        return (self._part(then) - self._part(self.time)) * self.velocity, left

    def _part(self, time: float) -> float:
        turn = 2.0 * np.pi / self.duration
        return time - float(np.sin(turn * time)) / turn


class ConstrainedDynamics:
    """M a + h = tau + sum J_k' f_k, with frames that are held: J_k a + dJ_k/dt v = -2 rate J_k v - rate^2 e_k
    (Baumgarte), solved by ``pin.constraintDynamics`` (Carpentier, Budhiraja, Mansard, Proximal and sparse resolution of
    constrained dynamic equations, RSS 2021); without any by ``pin.aba``.

    Args:
        rate: at which the drift e of a grip decays [1/s].
    """

    def __init__(self, model: pin.Model, rate: float) -> None:
        self.model, self.data, self._rate = model, model.createData(), rate
        #: Degrees of freedom that move by themselves
        self.free = list(range(model.nv))
        self._corrector = pin.BaumgarteCorrectorParameters(rate * rate, 2.0 * rate)
        self._settings = pin.ProximalSettings(1e-12, PROXIMAL, ITERATIONS)
        kinds = ((int(joint.idx_v), TURNING.get(joint.shortname(), 0)) for joint in model.joints)
        #: Where joints begin whose displacements do not commute, and what they are
        self.turning = [(start, size) for start, size in kinds if size]
        self.hold({})

    def reduced(self, matrix: Array) -> Array:
        """A matrix of forces by motions ``[nv, nv]``, of the motions that joints can make by themselves: all."""
        return matrix

    def coupled(self, q: Array, v: Array) -> tuple[Array, Array]:
        """A state in which joints that follow others are where they belong: any."""
        return q, v

    def hold(self, grips: Mapping[str, Grip]) -> None:
        model = self.model
        self._models, self._datas = pin.StdVec_RigidConstraintModel(), pin.StdVec_RigidConstraintData()
        self._rows: dict[str, list[int]] = {}
        for name, grip in grips.items():
            frame = model.frames[model.getFrameId(name)]
            points = [pin.SE3.Identity()]
            if grip.kind is GripKind.AXIS:
                points.append(pin.SE3(np.eye(3), np.array([0.0, 0.0, AXIS])))
            kind = pin.ContactType.CONTACT_6D if grip.kind is GripKind.POSE else pin.ContactType.CONTACT_3D
            self._rows[name] = []
            for point in points:
                row = pin.RigidConstraintModel(
                    kind, model, frame.parentJoint, frame.placement * point, 0, grip.pose * point,
                    pin.ReferenceFrame.LOCAL,
                )  # fmt: skip
                row.setBaumgarteCorrectorParameters(self._corrector)
                self._rows[name].append(len(self._models))
                self._models.append(row)
                self._datas.append(row.createData())
        self._held = bool(grips)
        if self._held:
            pin.initConstraintDynamics(model, self.data, self._models, self._datas)

    def acceleration(self, q: Array, v: Array, tau: Array) -> Array:
        if not self._held:
            return np.asarray(pin.aba(self.model, self.data, q, v, tau))
        return np.asarray(
            pin.constraintDynamics(self.model, self.data, q, v, tau, self._models, self._datas, self._settings)
        )

    def latched(self, q: Array, v: Array) -> Array:
        """The velocity after the grips have closed on moving frames, without a bounce: J v = 0 ``[nv]``."""
        if not self._held:
            return v
        for _ in range(ITERATIONS):
            v = pin.impulseDynamics(self.model, self.data, q, v, self._models, self._datas, 0.0, self._settings)
        return np.array(v)

    def wrenches(self) -> dict[str, Array]:
        """On the robot, in the axes of the frame and about its origin, of the last acceleration ``[6]`` [N, N m]."""
        out = {}
        for name, rows in self._rows.items():
            total = np.zeros(6)
            for k, row in enumerate(rows):
                force = np.array(self._datas[row].contact_force.vector)
                total += force
                if k == 1:
                    total[3:5] += AXIS * np.array([-force[1], force[0]])
            out[name] = total
        return out


Torque = Callable[[Array, Array], Array]


def step_rk4(dynamics: ConstrainedDynamics, q: Array, v: Array, torque: Torque, h: float) -> tuple[Array, Array]:
    """Runge-Kutta of order 4 on the manifold (Munthe-Kaas, BIT 38, 1998; commutators as by Hairer, Lubich and Wanner,
    IV.8), with velocities in the axes of the joints' own frames:

        q <- q (+) (h/6 (v1 + 2 v2 + 2 v3 + v4) + h^2/12 [v1, v4]),     v <- v + h/6 (a1 + 2 a2 + 2 a3 + a4)

    torque: (q, v) -> generalised force.
    """
    model, integrate, a = dynamics.model, pin.integrate, dynamics.acceleration
    a1 = a(q, v, torque(q, v))
    v2, q2 = v + 0.5 * h * a1, integrate(model, q, 0.5 * h * v)
    a2 = a(q2, v2, torque(q2, v2))
    v3, u = v + 0.5 * h * a2, 0.5 * h * v2
    _add_bracket(u, v, v2, h * h / 8.0, dynamics)
    q3 = integrate(model, q, u)
    a3 = a(q3, v3, torque(q3, v3))
    v4, q4 = v + h * a3, integrate(model, q, h * v3)
    a4 = a(q4, v4, torque(q4, v4))
    u = (h / 6.0) * (v + 2.0 * (v2 + v3) + v4)
    _add_bracket(u, v, v4, h * h / 12.0, dynamics)
    return integrate(model, q, u), v + (h / 6.0) * (a1 + 2.0 * (a2 + a3) + a4)


def step_midpoint(dynamics: ConstrainedDynamics, q: Array, v: Array, torque: Torque, h: float) -> tuple[Array, Array]:
    """Order 2 with half of the accelerations: q <- q (+) (h v + h^2/2 a), v <- v + h a, a at the middle of the step."""
    model, half = dynamics.model, 0.5 * h
    a = dynamics.acceleration(q, v, torque(q, v))
    between, rate = pin.integrate(model, q, half * v + (0.5 * half * half) * a), v + half * a
    a = dynamics.acceleration(between, rate, torque(between, rate))
    return pin.integrate(model, q, h * v + (h * half) * a), v + h * a


def _add_bracket(u: Array, a: Array, b: Array, factor: float, dynamics: ConstrainedDynamics) -> None:
    """Add factor [a, b], of the joints whose displacements do not commute."""
    for start, size in dynamics.turning:
        if size == 6:
            part = slice(start, start + 6)
            u[part] += factor * pin.Motion(a[part]).cross(pin.Motion(b[part])).vector
        elif size == 3:
            part = slice(start, start + 3)
            u[part] += factor * np.cross(a[part], b[part])
        else:
            (x, y, w), (ox, oy, ow) = a[start : start + 3], b[start : start + 3]
            u[start : start + 2] += factor * np.array([ow * y - w * oy, w * ox - ow * x])
