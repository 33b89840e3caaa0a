"""A MuJoCo model as a plant."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from wbc import extras
from wbc.errors import RangeError, ShapeError
from wbc.multibody import pin
from wbc.robot import Robot
from wbc.robot.mujoco_joints import MujocoJoints
from wbc.robot.robot import checked_robot
from wbc.robot.sources.mjactuators import control, force_ends, gears, joint_actuators
from wbc.robot.sources.mjnames import BALL, FREE
from wbc.simulation.plant import Command, CommandKind, PlantError, PlantState, numbers_of
from wbc.validation import Array

if TYPE_CHECKING:
    import mujoco


#: Of what motors can together, where they can nothing
TINY = 1e-300


@dataclass(frozen=True, eq=False)
class SavedMujocoState:
    """A MuJoCo plant's state at one time, see :meth:`MujocoPlant.save`; it may be pickled."""

    robot: str
    _numbers: Array
    _grips: object = None


class MujocoPlant:
    """A robot in MuJoCo: joints and actuators are found by their names, whatever their order.

        plant = MujocoPlant(mujoco.MjModel.from_xml_path(path), robot)
        plant.reset(q, 0.0)
        plant.apply(servo.step(plant.read().q).command)
        plant.advance(servo.controller.stack.dt)

    q and v are as of ``pin.Model``: quaternions x, y, z, w (MuJoCo: w, x, y, z), and the linear velocity of a free
    joint along the body's axes (MuJoCo: the world's). A position actuator takes positions, a velocity actuator
    velocities, and a motor torques; a command goes to the actuators of its kind, and the others keep what they have:
    positions of the reset, else 0.

    Args:
        model: a compiled model, ``mujoco.MjModel``. robot: has the same joints; other joints of the
            model, such as those of objects, move freely.

    Attributes:
        data: of the simulation, ``mujoco.MjData``, for what else a program wants to read or to push.

    Raises:
        MissingPackageError: MuJoCo is not installed.
        WbcError: as of :class:`wbc.robots.MujocoJoints`.
        RangeError: no actuator that drives a joint of the robot.
    """

    def __init__(self, model: mujoco.MjModel, robot: Robot) -> None:
        extras.require("mujoco", "MuJoCo as a plant")
        import mujoco

        self._step, self._forward, self._clear = mujoco.mj_step, mujoco.mj_forward, mujoco.mj_resetData
        self._get, self._set = mujoco.mj_getState, mujoco.mj_setState
        kinds = mujoco.mjtWarning
        self._blown = [int(k) for k in (kinds.mjWARN_BADQPOS, kinds.mjWARN_BADQVEL, kinds.mjWARN_BADQACC)]
        self._saved = int(mujoco.mjtState.mjSTATE_INTEGRATION)
        self._count = int(mujoco.mj_stateSize(model, self._saved))
        self._model, self._robot = model, checked_robot(robot)
        self.data = mujoco.MjData(model)
        self.nq, self.nv, self.time_step = robot.nq, robot.nv, float(model.opt.timestep)
        self._joints = MujocoJoints(model, robot)
        self._actuators = self._driven()
        if not self._actuators:
            raise RangeError("model", int(model.nu), "no actuator of the model drives a joint of the robot")
        self.commands: Collection[CommandKind] = tuple(self._actuators)
        self.reset(robot.neutral, 0.0)

    def _driven(self) -> dict[CommandKind, tuple[Array, Array, Array]]:
        """For each kind of command: places in ctrl, velocity coordinates, and ctrl for 1 there.

        Motors of one joint share its torque in proportion to what each can.
        """
        import mujoco

        m, found = self._model, dict[CommandKind, list[tuple[int, int, float]]]()
        for joint, column in self._joints.columns.items():
            motors = list[tuple[int, float, float]]()
            for a in joint_actuators(m, joint):
                if m.jnt_type[joint] in (FREE, BALL) or m.actuator_gaintype[a] != int(mujoco.mjtGain.mjGAIN_FIXED):
                    continue
                gain, gear = float(m.actuator_gainprm[a, 0]), float(gears(m, a, 1)[0])
                _, on_q, on_v = m.actuator_biasprm[a, :3]
                if on_q != 0.0 or on_v != 0.0:
                    kind = CommandKind.POSITION if on_q != 0.0 else CommandKind.VELOCITY
                    found.setdefault(kind, []).append((control(m, a), column, gear))
                elif gear * gain != 0.0:
                    motors.append((control(m, a), float(np.abs(gear * force_ends(m, a)).max()), gear * gain))
            reach = np.array([most for _, most, _ in motors])
            reach = np.isinf(reach) if np.isinf(reach).any() else reach
            for (at, _, scale), share in zip(motors, reach / max(reach.sum(), TINY), strict=True):
                found.setdefault(CommandKind.TORQUE, []).append((at, column, share / scale))
        made = {kind: np.array(rows).T for kind, rows in found.items()}
        return {kind: (a.astype(int), dof.astype(int), scale) for kind, (a, dof, scale) in made.items()}

    def reset(self, q: Array, time: float, v: Array | None = None) -> None:
        """At a configuration, at rest or with a velocity; position actuators hold it."""
        self._clear(self._model, self.data)
        self._joints.put_q(self.data.qpos, q)
        self._joints.put_v(self.data.qvel, q, np.zeros(self.nv) if v is None else v)
        self.data.time = time
        if CommandKind.POSITION in self._actuators:
            self.apply(Command(CommandKind.POSITION, np.asarray(q, dtype=float)))
        self._forward(self._model, self.data)

    def read(self) -> PlantState:
        """Where the joints are; not valid where the simulation has blown up."""
        data = self.data
        q, v = self._joints.q(data.qpos), self._joints.v(data.qpos, data.qvel)
        return PlantState(q, v, float(data.time), valid=bool(np.isfinite(q).all() and np.isfinite(v).all()))

    def apply(self, command: Command) -> None:
        """Write a command to the actuators of its kind.

        Raises:
            UnknownNameError: no actuator takes such commands. ShapeError, NotFiniteError: no numbers.
        """
        places = getattr(command, "kind", None) is CommandKind.POSITION
        values = numbers_of(command, self._actuators, self.nq if places else self.nv)
        actuators, dofs, scale = self._actuators[command.kind]
        if places:
            values = pin.difference(self._robot.model, pin.neutral(self._robot.model), values)
        self.data.ctrl[actuators] = scale * values[dofs]

    def _torques(self, values: Array) -> None:
        """Write torques ``[nv]``, checked before, to the motors."""
        actuators, dofs, scale = self._actuators[CommandKind.TORQUE]
        self.data.ctrl[actuators] = scale * values[dofs]

    def advance(self, dt: float) -> None:
        """Let whole time steps of the model go by [s].

        Raises:
            PlantError: the simulation has blown up. MuJoCo itself would put the robot back where its model begins.
        """
        for _ in range(round(dt / self.time_step)):
            self._step(self._model, self.data)
        self._check()

    def _check(self) -> None:
        """Refuses a simulation that has blown up."""
        warnings = self.data.warning
        if any(warnings[kind].number for kind in self._blown):
            raise PlantError("plant", float(self.data.time), "the simulation has blown up")

    def save(self) -> SavedMujocoState:
        """Everything that the next step depends on: MuJoCo's ``mjSTATE_INTEGRATION``, objects of the model included.

        What a program has changed in the model itself is not in it.
        """
        numbers = np.zeros(self._count)
        self._get(self._model, self.data, numbers, self._saved)
        return SavedMujocoState(self._robot.fingerprint, numbers)

    def restore(self, saved: SavedMujocoState) -> None:
        """Go on from there, to the same bits.

        Raises:
            RangeError: of another robot. ShapeError: of another MuJoCo model.
        """
        if saved.robot != self._robot.fingerprint:
            raise RangeError("saved", saved.robot, f"it is of another robot than {self._robot.name}")
        if saved._numbers.shape != (self._count,):
            reason = f"of another MuJoCo model: this one has {self._count} numbers"
            raise ShapeError("saved", saved._numbers.shape, reason)
        # What follows from the state, then the state again: the first changes from where the solver will begin
        self._set(self._model, self.data, saved._numbers, self._saved)
        self._forward(self._model, self.data)
        self._set(self._model, self.data, saved._numbers, self._saved)
