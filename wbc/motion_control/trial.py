"""One controller on one plant: a motion that is followed step by step, with encoders that are noisy."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np

from wbc import validation
from wbc.errors import RangeError, WbcError
from wbc.motion_control.motion import Motion, TorqueController
from wbc.multibody import pin
from wbc.robot import Robot
from wbc.simulation import Command, CommandKind, PinocchioPlant, PlantState
from wbc.symbolic.kinematics import frame_index
from wbc.validation import Array

PLANTS = ("pinocchio", "mujoco")
#: Longest step of a plant [s]
PLANT_STEP = 5e-4
#: An arm that is farther off than this has run away [rad, m], and why it did is of no interest
AWAY = 3.0


class TorquePlant(Protocol):
    """What a trial needs of a plant."""

    def reset(self, q: Array, time: float, v: Array | None = None) -> None: ...
    def apply(self, command: Command) -> None: ...
    def advance(self, dt: float) -> None: ...
    def read(self) -> PlantState: ...


@dataclass(frozen=True, eq=False)
class Trial:
    """What happened.

    Attributes:
        times: of the samples, the first at the start ``[n + 1]`` [s]. q: true configurations ``[n + 1, nq]``.
        errors: q_d (-) q of the joints ``[n + 1, nv - base]`` [rad or m]. torques: ``[n, nv]`` [N m or N].
        tip: distance of the tip from where the motion has it ``[n + 1]`` [m]. seconds: of each command ``[n]``.
        away: whether the robot ran away, and the rest is missing.
    """

    times: Array
    q: Array
    errors: Array
    torques: Array
    tip: Array
    seconds: Array
    away: bool = False


def loaded(robot: Robot, payload: float = 0.0, heavier: float = 1.0, frame: str | None = None) -> Robot:
    """The robot with a point mass at a frame [kg], and with links so many times heavier; default: at its tip.

    Raises:
        ShapeError, NotFiniteError, RangeError: no such numbers, or a payload at a frame that no joint moves.
        UnknownNameError: no such frame.
    """
    payload = validation.scalar("payload", payload, low=0.0, high=1e4, unit="kg")
    heavier = validation.scalar("heavier", heavier, low=0.1, high=10.0)
    where = robot.model.frames[frame_index(robot.model, tip_of(robot, frame))]
    model = robot.model.copy()
    for i in range(1, model.njoints):
        body = model.inertias[i]
        model.inertias[i] = pin.Inertia(heavier * body.mass, body.lever, heavier * body.inertia)
    if payload > 0.0:
        if where.parentJoint == 0:
            raise RangeError("frame", where.name, "no joint moves it: a payload there is none; name another frame")
        point = pin.Inertia(payload, where.placement.translation, np.zeros((3, 3)))
        model.inertias[where.parentJoint] = model.inertias[where.parentJoint] + point
    return replace(robot, model=model)


def tip_of(robot: Robot, frame: str | None = None) -> str:
    """A frame, by default the robot's tip, else its last one."""
    return robot.check_frame("frame", frame or robot.frames.get("tip", robot.frame_names[-1]))


def make_plant(kind: str, robot: Robot, dt: float) -> TorquePlant:
    """A plant of :data:`PLANTS` with steps that divide a control period [s].

    Raises:
        UnknownNameError: no such plant. MissingPackageError: MuJoCo is not installed.
    """
    step = dt / max(1, int(np.ceil(dt / PLANT_STEP - 1e-9)))
    if validation.one_of("plant", kind, PLANTS) == "pinocchio":
        return PinocchioPlant(robot, step)
    from wbc.simulation.mujoco_model import mujoco_model
    from wbc.simulation.mujoco_plant import MujocoPlant

    return MujocoPlant(mujoco_model(robot, time_step=step), robot)


def run_trial(
    plant: TorquePlant,
    robot: Robot,
    controller: TorqueController,
    motion: Motion,
    dt: float,
    seconds: float,
    *,
    frame: str | None = None,
    noise: float = 0.0,
    seed: int = 0,
    tick: Callable[[], None] = lambda: None,
) -> Trial:
    """Let a controller follow a motion from its start, where the robot already moves as desired.

    Args:
        robot: of the kinematics. dt: control period [s]. frame: whose distance is told; default: the tip.
        noise: standard deviation of measured joints [rad, m]; where there is any, velocities are differences over a
            step. tick: called after every step.

    Raises:
        RangeError: no whole number of steps, at least one.
    """
    dt = validation.scalar("dt", dt, low=0.0, open_low=True, unit="s")
    steps = round(validation.scalar("seconds", seconds, low=0.0, open_low=True, unit="s") / dt)
    if steps < 1 or abs(steps * dt - seconds) > 1e-9 * seconds:
        raise RangeError("dt", dt, f"expected a whole number of steps in {seconds:g} s")
    noise = validation.scalar("noise", noise, low=0.0)
    random, model, base = np.random.default_rng(validation.integer("seed", seed)), robot.model, robot.base_nv
    index, data = frame_index(model, tip_of(robot, frame)), model.createData()
    q, v, _ = motion(0.0)
    plant.reset(q, 0.0, v)
    seen, rate = q, v
    rows: list[tuple[Array, Array, Array, float]] = []
    places, away = [(q, *_off(model, data, index, q, motion(0.0)[0], base))], False
    for k in range(steps):
        if noise and k > 0:
            shift = np.concatenate([np.zeros(base), noise * random.normal(size=model.nv - base)])
            last, seen = seen, pin.integrate(model, q, shift)
            rate = pin.difference(model, last, seen) / dt
            rate[:base] = v[:base]
        elif not noise:
            seen, rate = q, v
        begun = time.perf_counter()
        torque = controller.command(k * dt, seen, rate)
        spent = time.perf_counter() - begun
        plant.apply(Command(CommandKind.TORQUE, torque))
        try:
            plant.advance(dt)
        except WbcError:
            away = True
            break
        state = plant.read()
        q, v = state.q, state.v
        error, distance = _off(model, data, index, q, motion((k + 1) * dt)[0], base)
        away = not state.valid or not np.abs(error).max() < AWAY
        if away:
            break
        rows.append((torque, rate, seen, spent))
        places.append((q, error, distance))
        tick()
    return Trial(
        np.asarray(dt * np.arange(len(places)), dtype=np.float64),
        np.array([place[0] for place in places]),
        np.array([place[1] for place in places]),
        np.array([row[0] for row in rows]).reshape(-1, model.nv),
        np.array([place[2] for place in places]),
        np.array([row[3] for row in rows]),
        away,
    )


def _off(model: pin.Model, data: pin.Data, index: int, q: Array, wanted: Array, base: int) -> tuple[Array, float]:
    """Error of the joints, and distance of the frame, with the base where it is."""
    error = pin.difference(model, q, wanted)[base:]
    moved = pin.integrate(model, q, np.concatenate([np.zeros(base), error]))
    places = []
    for at in (q, moved):
        pin.forwardKinematics(model, data, at)
        places.append(pin.updateFramePlacement(model, data, index).translation.copy())
    return error, float(np.linalg.norm(places[1] - places[0]))
