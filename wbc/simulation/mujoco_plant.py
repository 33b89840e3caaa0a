"""A MuJoCo model as a plant."""

from __future__ import annotations

from collections.abc import Collection
from typing import TYPE_CHECKING

import numpy as np
import pinocchio as pin

from wbc.errors import RangeError, UnsupportedJointError
from wbc.robot import Robot
from wbc.robot.robot import checked_robot
from wbc.simulation.plant import Command, CommandKind, PlantState
from wbc.validation import Array, one_of

if TYPE_CHECKING:
    import mujoco

#: Numbers of a joint in qpos and in qvel, by MuJoCo's type: free, ball, slide, hinge
SIZES = {0: (7, 6), 1: (4, 3), 2: (1, 1), 3: (1, 1)}
#: A quaternion w, x, y, z from one x, y, z, w, and the reverse
TO_MUJOCO, TO_PINOCCHIO = [3, 0, 1, 2], [1, 2, 3, 0]


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
        ModuleNotFoundError: ``pip install wbc[mujoco]`` is to be done.
        UnknownNameError: a joint that the model does not have. UnsupportedJointError: it has it with other numbers.
        RangeError: no actuator that drives a joint of the robot.
    """

    def __init__(self, model: mujoco.MjModel, robot: Robot) -> None:
        import mujoco

        self._step, self._forward, self._clear = mujoco.mj_step, mujoco.mj_forward, mujoco.mj_resetData
        self._model, self._robot = model, checked_robot(robot)
        self.data = mujoco.MjData(model)
        self.nq, self.nv, self.time_step = robot.nq, robot.nv, float(model.opt.timestep)
        names = {model.joint(j).name: j for j in range(model.njnt)}
        #: For each joint: where its numbers begin, in qpos, qvel, q and v, and how many these are there
        self._places: list[tuple[int, int, int, int, int, int]] = []
        for k, name in enumerate(robot.joint_names, start=1):
            j = names[one_of("robot.joint_names", name, names)]
            pins = int(robot.model.nqs[k]), int(robot.model.nvs[k])
            if pins not in (SIZES[int(model.jnt_type[j])], (2, 1)):
                raise UnsupportedJointError(
                    "model", name, f"it has {SIZES[int(model.jnt_type[j])]} numbers, the robot's joint {pins}"
                )
            starts = int(robot.model.idx_qs[k]), int(robot.model.idx_vs[k])
            self._places.append((int(model.jnt_qposadr[j]), int(model.jnt_dofadr[j]), *starts, *pins))
        self._actuators = self._driven(names)
        if not self._actuators:
            raise RangeError("model", int(model.nu), "no actuator of the model drives a joint of the robot")
        self.commands: Collection[CommandKind] = tuple(self._actuators)
        self.reset(robot.neutral, 0.0)

    def _driven(self, names: dict[str, int]) -> dict[CommandKind, tuple[Array, Array, Array]]:
        """For each kind of command: actuators, velocity coordinates, and ctrl for 1 there."""
        m, robot, found = self._model, self._robot, dict[CommandKind, list[tuple[int, int, float]]]()
        joints = {names[name]: k for k, name in enumerate(robot.joint_names, start=1)}
        for a in range(m.nu):
            k = joints.get(int(m.actuator_trnid[a, 0]), 0) if int(m.actuator_trntype[a]) in (0, 1) else 0
            if k == 0 or int(robot.model.nvs[k]) != 1:
                continue
            gain, (_, on_q, on_v) = float(m.actuator_gainprm[a, 0]), m.actuator_biasprm[a, :3]
            kind = CommandKind.TORQUE
            if on_q != 0.0 or on_v != 0.0:
                kind = CommandKind.POSITION if on_q != 0.0 else CommandKind.VELOCITY
            gear = float(m.actuator_gear[a, 0])
            scale = 1.0 / (gear * gain) if kind is CommandKind.TORQUE else gear
            found.setdefault(kind, []).append((a, int(robot.model.idx_vs[k]), scale))
        columns = {kind: np.array(rows).T for kind, rows in found.items()}
        return {kind: (a.astype(int), dof.astype(int), scale) for kind, (a, dof, scale) in columns.items()}

    def reset(self, q: Array, time: float, v: Array | None = None) -> None:
        """At a configuration, at rest or with a velocity; position actuators hold it."""
        self._clear(self._model, self.data)
        self._write(np.asarray(q, dtype=float), np.zeros(self.nv) if v is None else np.asarray(v, dtype=float))
        self.data.time = time
        if CommandKind.POSITION in self._actuators:
            self.apply(Command(CommandKind.POSITION, np.asarray(q, dtype=float)))
        self._forward(self._model, self.data)

    def read(self) -> PlantState:
        """Where the joints are; not valid where the simulation has blown up."""
        q, v, data = np.empty(self.nq), np.empty(self.nv), self.data
        for at, dof, start, column, nq, nv in self._places:
            here, rate = data.qpos[at : at + max(nq, 1)], data.qvel[dof : dof + nv]
            if nq == 2:
                q[start : start + 2] = np.cos(here[0]), np.sin(here[0])
            elif nq == 7:
                q[start : start + 3], q[start + 3 : start + 7] = here[:3], here[3:][TO_PINOCCHIO]
                v[column : column + 3] = _rotation(q[start + 3 : start + 7]).T @ rate[:3]
                v[column + 3 : column + 6] = rate[3:]
                continue
            else:
                q[start : start + nq] = here[TO_PINOCCHIO] if nq == 4 else here
            v[column : column + nv] = rate
        return PlantState(q, v, float(data.time), valid=bool(np.isfinite(q).all() and np.isfinite(v).all()))

    def _write(self, q: Array, v: Array) -> None:
        data = self.data
        for at, dof, start, column, nq, nv in self._places:
            here, rate = q[start : start + nq], v[column : column + nv].copy()
            if nq == 2:
                data.qpos[at] = np.arctan2(here[1], here[0])
            elif nq == 7:
                data.qpos[at : at + 7] = [*here[:3], *here[3:][TO_MUJOCO]]
                rate[:3] = _rotation(here[3:]) @ rate[:3]
            else:
                data.qpos[at : at + nq] = here[TO_MUJOCO] if nq == 4 else here
            data.qvel[dof : dof + nv] = rate

    def apply(self, command: Command) -> None:
        """Write a command to the actuators of its kind.

        Raises:
            UnknownNameError: no actuator takes such commands.
        """
        one_of("command.kind", str(command.kind), [str(kind) for kind in self._actuators])
        actuators, dofs, scale = self._actuators[command.kind]
        values = command.values
        if command.kind is CommandKind.POSITION:
            values = pin.difference(self._robot.model, pin.neutral(self._robot.model), values)
        self.data.ctrl[actuators] = scale * values[dofs]

    def advance(self, dt: float) -> None:
        """Let whole time steps of the model go by [s]."""
        for _ in range(round(dt / self.time_step)):
            self._step(self._model, self.data)


def _rotation(quaternion: Array) -> Array:
    return np.asarray(pin.Quaternion(quaternion).toRotationMatrix())
