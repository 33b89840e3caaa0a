"""A robot with masses, motors and encoders, of which frames may be held and points may touch the ground."""

from __future__ import annotations

import copy
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from wbc import validation
from wbc.errors import RangeError
from wbc.multibody import pin
from wbc.robot import Robot
from wbc.robot.robot import checked_robot
from wbc.simulation.coupled import CoupledDynamics
from wbc.simulation.dynamics import ConstrainedDynamics, Integrator, step_midpoint, step_rk4
from wbc.simulation.gripping import Gripping, GrippingState
from wbc.simulation.ground import Ground, Touch
from wbc.simulation.momentum import Balance
from wbc.simulation.motors import Encoders, Motors, PlantMotors
from wbc.simulation.plant import GripKind, PlantError, PlantState
from wbc.simulation.stability import largest_step
from wbc.validation import Array

INTEGRATORS: Mapping[Integrator, Any] = {"rk4": step_rk4, "midpoint": step_midpoint}
#: A mass matrix with a smaller ratio of its least to its largest eigenvalue is singular
SINGULAR = 1e-9


@dataclass(eq=False, kw_only=True)
class _PinocchioState(GrippingState):
    """All that changes: what :meth:`PinocchioPlant.save` copies."""

    q: Array
    v: Array
    time: float
    anchors: Array
    reading: PlantState


@dataclass(frozen=True, eq=False)
class SavedState:
    """A plant's state at one time, see :meth:`PinocchioPlant.save`; it may be pickled."""

    robot: str
    _state: _PinocchioState


class PinocchioPlant(Gripping):
    """Rigid bodies by Pinocchio: M a + h = tau + J'f, with closed grips as hard constraints.

        plant = PinocchioPlant(robot, motors=Motors(viscous=0.5, delay=0.002), encoders=Encoders(position=1e-5), seed=1)
        plant.reset(q, 0.0)
        plant.grasp("arm1_hand", pose, GripKind.POSE)
        plant.apply(Command(CommandKind.TORQUE, tau))
        plant.advance(0.001)

    It takes torques; those of a base's coordinates do nothing. The same seed and commands give the same bits. Joints
    that follow others do so through rigid gears: their motors' torques act on what leads them; closed loops are hard
    constraints (:class:`CoupledDynamics`, which takes longer). Torques of passive joints do nothing.

    Args:
        robot: what moves, with its true masses, its gravity and its limits of effort.
        time_step: [s].
        integrator: ``"rk4"``, or ``"midpoint"``: half the time, and drift of second order in the step.
        motors, encoders: default: torques as commanded within the limits of effort, and exact readings.
        payloads: frame -> inertia fixed to it.
        gravity: [m/s^2]; None: the model's.
        ground: what its frames can touch; None: nothing.
        rate: at which the drift of grips decays [1/s].
        seed: of all noise.

    Raises:
        RangeError: a link of negative mass or inertia, a mass matrix that is singular at the robot's neutral
            configuration, a time step that is too coarse (the largest that works is named). UnknownNameError: no such
            frame or integrator. ShapeError, NotFiniteError: numbers that are none.
    """

    _state: _PinocchioState

    def __init__(
        self,
        robot: Robot,
        time_step: float = 0.001,
        *,
        integrator: Integrator = "rk4",
        motors: Motors | None = None,
        encoders: Encoders | None = None,
        payloads: Mapping[str, pin.Inertia] | None = None,
        gravity: Any = None,
        ground: Ground | None = None,
        rate: float = 20.0,
        seed: int = 0,
    ) -> None:
        self.robot = checked_robot(robot)
        self.nq, self.nv = robot.nq, robot.nv
        self.time_step = validation.scalar("time_step", time_step, low=0.0, open_low=True, unit="s")
        validation.one_of("integrator", integrator, INTEGRATORS)
        self._integrator, self._step = integrator, INTEGRATORS[integrator]
        self._rate = validation.scalar("rate", rate, low=0.0, unit="1/s")
        self._seed = validation.integer("seed", seed)
        self._encoders = encoders or Encoders()
        self._drive = PlantMotors(motors or Motors(), robot, self.time_step)
        model = robot.model.copy()
        for name, inertia in (payloads or {}).items():
            frame = model.frames[model.getFrameId(robot.check_frame("payloads", name))]
            model.inertias[frame.parentJoint] += frame.placement.act(inertia)
        model.armature = model.armature + self._drive.armature
        if gravity is not None:
            model.gravity.linear = validation.real_array("gravity", gravity, (3,))
        self.model = model
        _check_inertias(model)
        self._balance, self._placed = Balance(model), model.createData()
        follows = bool(robot.couplings or robot.loops) or any("Mimic" in joint.shortname() for joint in model.joints)
        self._dynamics = (
            CoupledDynamics(robot, model, self._rate) if follows else ConstrainedDynamics(model, self._rate)
        )
        self._touch = None if ground is None else Touch(ground, robot, model)
        self._check_mass(robot.neutral)
        self._check_step(robot.neutral)
        self._torque = np.zeros(self.nv)
        self._begin(robot.neutral, 0.0, np.zeros(self.nv))

    # What a loop does

    def reset(self, q: Array, time: float, v: Array | None = None) -> None:
        """At a configuration, at rest or with a velocity, with no command, and nothing grasped.

        Raises:
            RangeError: it is inside of the ground, or a joint is not where the one that it follows puts it, or a loop
                is open; or there the mass matrix is singular or the time step too coarse.
        """
        q = self.robot.configuration("q", q)
        v = np.zeros(self.nv) if v is None else validation.real_array("v", v, (self.nv,))
        q, v = self._dynamics.coupled(q, v)
        self._check_mass(q)
        self._check_step(q)
        if self._touch is not None:
            self._touch.check(q)
        self._begin(q, time, v)

    def _begin(self, q: Array, time: float, v: Array) -> None:
        anchors = np.zeros((0, 3)) if self._touch is None else self._touch.fresh()
        self._state = _PinocchioState(
            q=q, v=v, time=time, anchors=anchors, reading=PlantState(q, v, time), command=np.zeros(self.nv),
            motors=self._drive.fresh(), scale=self._drive.driven.copy(), random=np.random.default_rng(self._seed),
        )  # fmt: skip
        self._hold()
        self._state.first = self._balance.momentum(q, v)
        self._sense()

    def read(self) -> PlantState:
        """What encoders read; of a base the truth."""
        return self._state.reading

    def advance(self, dt: float) -> None:
        """Whole time steps.

        Raises:
            PlantError: the simulation has blown up, which a state says with numbers that are none.
        """
        state, h, balance = self._state, self.time_step, self._balance
        for _ in range(round(dt / h)):
            self._torque = self._motors_on(state.v)
            if state.slips:
                self._slide(h)
            if self._touch is not None:
                self._touch.force(state.q, state.v, state.anchors, settle=True)
            state.q, state.v = self._step(self._dynamics, state.q, state.v, self._forces, h)
            state.time += h
            if balance.falls:
                state.fallen += balance.by_gravity(state.q, h)
        if not np.isfinite(state.q.dot(state.q) + state.v.dot(state.v)):
            raise PlantError("plant", state.time, "the simulation has blown up")
        self._sense()

    # What grasps

    def grasp(self, frame: str, pose: pin.SE3, kind: GripKind = GripKind.POSE) -> None:
        """A frame is held: its velocity is gone at once, without a bounce, and what it is off decays with ``rate``.

        Raises:
            UnknownNameError: no such frame or kind. RangeError: held already, or farther from the pose than 10 mm or,
                as far as the kind holds it, 0.1 rad.
        """
        state = self._state
        self._take(self.robot.check_frame("frame", frame), pose, kind)
        state.v = self._dynamics.latched(state.q, state.v)

    # What is known of it

    @property
    def state(self) -> PlantState:
        state = self._state
        return PlantState(state.q, state.v, state.time)

    @property
    def wrenches(self) -> Mapping[str, Array]:
        """Frame -> what its grip exerts on the robot, in the frame's axes and about its origin, in the last
        acceleration that was computed ``[6]`` [N, N m].
        """
        return self._dynamics.wrenches()

    @property
    def energy(self) -> float:
        """Kinetic and potential [J], with that of the rotors."""
        state, model, data = self._state, self.model, self._dynamics.data
        kinetic = 0.5 * float(state.v @ pin.crba(model, data, state.q) @ state.v)
        return kinetic + float(pin.computePotentialEnergy(model, data, state.q))

    def acceleration(self, tau: Array) -> Array:
        """Of this state under these generalised forces, grips and ground included ``[nv]``."""
        state = self._state
        if self._touch is not None:
            tau = tau + self._touch.force(state.q, state.v, state.anchors)
        return self._dynamics.acceleration(state.q, state.v, tau)

    def save(self) -> SavedState:
        """Everything that the next step depends on."""
        return SavedState(self.robot.fingerprint, copy.deepcopy(self._state))

    def restore(self, saved: SavedState) -> None:
        """Go on from there, to the same bits.

        Raises:
            RangeError: of another robot.
        """
        if saved.robot != self.robot.fingerprint:
            raise RangeError("saved", saved.robot, f"it is of another robot than {self.robot.name}")
        self._state = copy.deepcopy(saved._state)
        self._hold()

    def _forces(self, q: Array, v: Array) -> Array:
        tau = self._torque
        if self._drive.rubs:
            tau = tau - self._drive.friction(v)
        if self._touch is not None:
            tau = tau + self._touch.force(q, v, self._state.anchors)
        return tau

    def _changed(self, frame: str) -> None:
        self._hold()

    def _hold(self) -> None:
        self._dynamics.hold(self._state.grips)

    def _sense(self) -> None:
        state, encoders, base = self._state, self._encoders, self.robot.base_nv
        q, v = state.q, state.v
        if encoders.position > 0.0:
            noise = encoders.position * state.random.standard_normal(self.nv)
            noise[:base] = 0.0
            q = np.asarray(pin.integrate(self.model, q, noise))
        if encoders.resolution > 0.0:
            q, k = q.copy(), self.robot.position_index
            joints = [i for i in range(base, self.nv) if k[i] >= 0]
            places = k[joints].astype(int)
            q[places] = encoders.resolution * np.round(q[places] / encoders.resolution)
        if encoders.velocity > 0.0:
            noise = encoders.velocity * state.random.standard_normal(self.nv)
            noise[:base] = 0.0
            v = v + noise
        state.reading = PlantState(q, v, state.time)

    def _check_mass(self, q: Array) -> None:
        mass = self._dynamics.reduced(pin.crba(self.model, self._dynamics.data, q))
        values, vectors = np.linalg.eigh(mass)
        if self.nv and not values[0] > SINGULAR * values[-1]:
            dof = self.robot.dof_names[self._dynamics.free[int(np.abs(vectors[:, 0]).argmax())]]
            raise RangeError(
                "robot", self.robot.name, f"its mass matrix is singular: nothing that {dof} moves has inertia"
            )

    def _check_step(self, q: Array) -> None:
        model, data = self.model, self._dynamics.data
        stiffness, damping = np.zeros((self.nv, self.nv)), np.diag(self._drive.damping)
        if self._touch is not None:
            more = self._touch.stiffness(q)
            stiffness, damping = stiffness + more[0], damping + more[1]
        mass, stiffness, damping = (
            self._dynamics.reduced(matrix) for matrix in (pin.crba(model, data, q), stiffness, damping)
        )
        most = largest_step(mass, stiffness, damping, self._rate, self._integrator)
        if self.time_step > most:
            raise RangeError(
                "time_step", self.time_step, f"too coarse for this plant: the largest that works is {most:.3g} s"
            )


def _check_inertias(model: pin.Model) -> None:
    """Refuse links that no body can be: negative mass, or an inertia with an eigenvalue below 0."""
    for k, inertia in enumerate(model.inertias):
        name = str(model.names[k])
        if inertia.mass < 0.0:
            raise RangeError("robot", float(inertia.mass), f"the bodies at {name} have a negative mass")
        values = np.linalg.eigvalsh(inertia.inertia)
        if values[0] < -1e-9 * max(float(np.abs(values).max()), 1e-12):
            raise RangeError("robot", values.tolist(), f"the bodies at {name} have a negative moment of inertia")
