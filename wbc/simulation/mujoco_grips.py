"""A robot in MuJoCo of which frames may be held."""

from __future__ import annotations

import copy
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np

from wbc import validation
from wbc.errors import ShapeError, WbcError
from wbc.multibody import pin
from wbc.robot import Robot
from wbc.simulation.dynamics import AXIS
from wbc.simulation.gripping import Gripping, GrippingState
from wbc.simulation.momentum import Balance
from wbc.simulation.motors import Motors, PlantMotors
from wbc.simulation.mujoco_model import HARD, SOFT, mujoco_spec
from wbc.simulation.mujoco_plant import MujocoPlant, SavedMujocoState
from wbc.simulation.plant import GripKind, PlantState
from wbc.validation import Array

if TYPE_CHECKING:
    import mujoco

#: Points of a frame that its grip holds, as many as the kind needs [m]
POINTS = AXIS * np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]])
#: A frame that is so near to its hold is there [m]
NEAR = 1e-12
HELD = {GripKind.POSITION: 1, GripKind.AXIS: 2, GripKind.POSE: 3}


@dataclass(eq=False, kw_only=True)
class _GripState(GrippingState):
    """All that changes beside MuJoCo's own state."""

    off: dict[str, Array] = field(default_factory=dict)


class GrippingMujocoPlant(Gripping, MujocoPlant):
    """A robot of ours in MuJoCo (:func:`mujoco_model`) that takes torques, and can grasp.

    A grip is a ``connect`` of one, two or three points of the frame. MuJoCo's constraints are springs: a grip gives way
    under load, the less the shorter the time constant. It goes with its mass, and is not one number [m/N]. What a frame
    is off when it closes decays with ``rate``, as in :class:`PinocchioPlant`: the springs would take it within a step.

    Args:
        frames: that can be held. time_step: [s].
        time_constant: of the grips [s]; None: two time steps, the least that MuJoCo takes. rate: [1/s].
        motors: default: torques as commanded within the limits of effort. seed: of their noise.
        spec: of :func:`mujoco_spec` of this robot with motors, and what else stands in the world; its time step counts.
            None: the robot alone.

    Raises:
        UnknownNameError: no such frame. What :func:`mujoco_model` raises.
    """

    _state: _GripState

    def __init__(
        self,
        robot: Robot,
        frames: Sequence[str],
        time_step: float = 0.001,
        *,
        time_constant: float | None = None,
        rate: float = 20.0,
        motors: Motors | None = None,
        seed: int = 0,
        spec: mujoco.MjSpec | None = None,
    ) -> None:
        import mujoco

        if spec is None:
            spec = mujoco_spec(robot, time_step=time_step, actuators="torque", drawn=False)
        time_step = float(spec.option.timestep)
        self._drive = PlantMotors(motors or Motors(), robot, time_step)
        for start, armature in enumerate(self._drive.armature):
            if armature:
                spec.joint(robot.dof_names[start]).armature += armature
        soft = SOFT * time_step if time_constant is None else time_constant
        soft = validation.scalar("time_constant", soft, low=SOFT * time_step, unit="s")
        for name in frames:
            frame = robot.model.frames[robot.model.getFrameId(robot.check_frame("frames", name))]
            body = spec.joint(str(robot.model.names[frame.parentJoint])).parent
            for k in range(len(POINTS)):
                held = spec.add_equality(type=mujoco.mjtEq.mjEQ_CONNECT, objtype=mujoco.mjtObj.mjOBJ_BODY)
                held.name, held.name1, held.active = f"{name} {k}", body.name, False
                held.solref, held.solimp = [soft, 1.0], HARD
        model = spec.compile()
        self._equality = int(mujoco.mjtConstraint.mjCNSTR_EQUALITY)
        self._rows = {name: [int(model.equality(f"{name} {k}").id) for k in range(len(POINTS))] for name in frames}
        frames_of = robot.model.frames
        self._placements = {
            name: np.array(frames_of[robot.model.getFrameId(name)].placement.rotation) for name in frames
        }
        self._closer = np.exp(-time_step * validation.scalar("rate", rate, low=0.0, unit="1/s"))
        self._balance, self._placed, self._seed = Balance(robot.model), robot.model.createData(), seed
        self.robot = robot
        MujocoPlant.__init__(self, model, robot)
        self.commands = Gripping.commands

    def reset(self, q: Array, time: float, v: Array | None = None) -> None:
        super().reset(q, time, v)
        drive = self._drive
        self._state = _GripState(command=np.zeros(self.nv), motors=drive.fresh(), scale=drive.driven.copy(),
                             random=np.random.default_rng(self._seed))  # fmt: skip
        self._state.first = self.momentum

    def advance(self, dt: float) -> None:
        h, drive, state = self.time_step, self._drive, self._state
        for _ in range(round(dt / h)):
            # Motors whose torque does not depend on velocities need none
            v = self.read().v if drive.felt else state.command
            torque = self._motors_on(v)
            if drive.rubs:
                torque = torque - drive.friction(v)
            q = self._joints.q(self.data.qpos) if self._balance.falls else None
            self._torques(torque)
            if state.slips:
                self._slide(h)
            for name in list(state.off):
                self._close(name)
            self._step(self._model, self.data)
            if q is not None:
                state.fallen += self._balance.by_gravity(q, h)
        self._check()

    def grasp(self, frame: str, pose: pin.SE3, kind: GripKind = GripKind.POSE) -> None:
        """A frame is held at a pose of the world.

        Raises:
            UnknownNameError: no such frame or kind. RangeError: held already, or out of reach, as of
                :meth:`PinocchioPlant.grasp`.
        """
        at = self._take(validation.one_of("frame", frame, self._rows), pose, kind)
        points = POINTS[: HELD[self._state.grips[frame].kind]]
        self._state.off[frame] = np.array([at.act(p) - pose.act(p) for p in points])
        self._hold(frame)

    @property
    def state(self) -> PlantState:
        return self.read()

    @property
    def wrenches(self) -> dict[str, Array]:
        """As of :attr:`PinocchioPlant.wrenches`."""
        data, out = self.data, dict[str, Array]()
        ours = np.asarray(data.efc_type[: data.nefc]) == self._equality
        numbers, forces = np.asarray(data.efc_id[: data.nefc]), np.asarray(data.efc_force[: data.nefc])
        for name, grip in self._state.grips.items():
            total, rows = np.zeros(6), self._rows[name]
            # The frame's own axes: a hand that rolls on its hold turns away from where it closed
            body = data.xmat[self._model.eq_obj1id[rows[0]]].reshape(3, 3)
            rotation = body @ self._placements[name]
            for row, point in zip(rows[: HELD[grip.kind]], POINTS, strict=False):
                force = rotation.T @ forces[ours & (numbers == row)]
                total += np.append(force, pin.skew(point) @ force)
            out[name] = total
        return out

    def save(self) -> SavedMujocoState:
        return replace(super().save(), _grips=copy.deepcopy(self._state))

    def restore(self, saved: SavedMujocoState) -> None:
        """As of :class:`MujocoPlant`.

        Raises:
            ShapeError: it was saved by a plant without grips.
        """
        if not isinstance(saved._grips, _GripState):
            raise ShapeError("saved", saved._grips, "of a plant without grips")
        for name in saved._grips.grips:
            validation.one_of("saved.grips", name, self._rows)
        before, self._state = self._state, copy.deepcopy(saved._grips)
        for name in self._state.grips:
            self._hold(name)
        try:
            super().restore(saved)
        except WbcError:
            self._state = before
            raise

    def _changed(self, frame: str) -> None:
        if frame in self._state.grips:
            self._hold(frame)
            return
        self._state.off.pop(frame, None)
        for row in self._rows[frame]:
            self.data.eq_active[row] = 0

    def _hold(self, frame: str) -> None:
        """Write a grip into the model, and switch it on."""
        grip, model = self._state.grips[frame], self._robot.model
        place, off = model.frames[model.getFrameId(frame)].placement, self._state.off.get(frame, np.zeros(POINTS.shape))
        for row, point, gap in zip(self._rows[frame][: HELD[grip.kind]], POINTS, off, strict=False):
            self._model.eq_data[row, :3], self._model.eq_data[row, 3:6] = place.act(point), grip.pose.act(point) + gap
            self.data.eq_active[row] = 1

    def _close(self, name: str) -> None:
        """A frame that has closed comes to its hold, a step on."""
        self._state.off[name] *= self._closer
        self._hold(name)
        if np.abs(self._state.off[name]).max() < NEAR:
            del self._state.off[name]
