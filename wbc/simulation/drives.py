"""Drives that follow velocities by torques: what electronics between a velocity loop and motors do."""

from __future__ import annotations

from collections.abc import Collection

import numpy as np

from wbc import validation
from wbc.errors import RangeError, ShapeError
from wbc.multibody import pin
from wbc.robot import Robot
from wbc.robot.robot import checked_robot
from wbc.simulation.plant import Command, CommandKind, Plant, PlantState, numbers_of
from wbc.validation import Array

#: How fast errors of the reference decay [1/s], twice
BANDWIDTH = 50.0


class VelocityDrive:
    """A plant that takes velocities, and drives one on a fixed base that takes torques by computed torque
    (Luh, Walker, Paul, Resolved-acceleration control of mechanical manipulators, IEEE TAC 25, 1980):

        tau = G' (M (dv_ref/dt + 2 omega (v_ref - v) + omega^2 (q_ref - q)) + h)

    with G of :meth:`~wbc.robot.Robot.motor_jacobian` where there are loops or passive joints, else 1. Within a period
    v_ref goes from the last velocity to the new one in a straight line, and q_ref is its integral.

        wbc.track.track(plan, plant=VelocityDrive(robot, PinocchioPlant(robot)))

    Args:
        robot: as the drive knows it; the plant's may have other masses. plant: takes torques.
        bandwidth: omega [1/s].

    Raises:
        ShapeError: a plant that takes no torques. RangeError: a base that moves, which no motor drives.
    """

    commands: Collection[CommandKind] = (CommandKind.VELOCITY,)

    def __init__(self, robot: Robot, plant: Plant, bandwidth: float = BANDWIDTH) -> None:
        if checked_robot(robot).base != "fixed":
            raise RangeError("robot", robot.name, f"its base is {robot.base}: no motor drives it")
        if CommandKind.TORQUE not in plant.commands:
            raise ShapeError("plant", type(plant).__name__, "expected a plant that takes torques")
        self.plant, self.nq, self.nv, self.time_step = plant, plant.nq, plant.nv, plant.time_step
        self._robot, self._model, self._data = robot, robot.model, robot.model.createData()
        self._omega = validation.scalar("bandwidth", bandwidth, low=0.0, open_low=True, unit="1/s")
        self._command = Command(CommandKind.TORQUE, np.zeros(self.nv))

    def reset(self, q: Array, time: float) -> None:
        """At rest, where the reference is too."""
        self.plant.reset(q, time)
        self._q, self._v, self._next = np.array(q), np.zeros(self.nv), np.zeros(self.nv)

    def read(self) -> PlantState:
        return self.plant.read()

    def apply(self, command: Command) -> None:
        """Take velocities, for the next period."""
        self._next = numbers_of(command, self.commands, self.nv)

    def advance(self, dt: float) -> None:
        """A period: a torque for each time step of the plant."""
        model, h, omega, plant = self._model, self.time_step, self._omega, self.plant
        count = max(round(dt / h), 1)
        ramp = (self._next - self._v) / count
        for _ in range(count):
            state = plant.read()
            a = ramp / h + 2.0 * omega * (self._v - state.v)
            a += omega * omega * pin.difference(model, state.q, self._q)
            self._command.values[:] = self._robot.at_motors(state.q, pin.rnea(model, self._data, state.q, state.v, a))
            plant.apply(self._command)
            plant.advance(h)
            self._q = pin.integrate(model, self._q, (self._v + 0.5 * ramp) * h)
            self._v = self._v + ramp


#: Plants of robots that follow velocities, by name
PLANTS = ("kinematic", "pinocchio", "mujoco")


def driven(name: str, robot: Robot, time_step: float = 0.001) -> Plant | None:
    """A robot with drives on a simulator of a name of :data:`PLANTS`; None for the kinematic one.

    Raises:
        UnknownNameError: no such plant. RangeError: a robot without masses, or whose base moves.
        MissingPackageError: MuJoCo is not installed.
    """
    from wbc.simulation.mujoco_model import mujoco_model
    from wbc.simulation.mujoco_plant import MujocoPlant
    from wbc.simulation.pinocchio_plant import PinocchioPlant

    validation.one_of("plant", name, PLANTS)
    if name == "kinematic":
        return None
    plant: Plant = PinocchioPlant(robot, time_step)
    if name == "mujoco":
        plant = MujocoPlant(mujoco_model(robot, time_step=time_step), robot)
    return VelocityDrive(robot, plant)
