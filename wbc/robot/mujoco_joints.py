"""Numbers of MuJoCo and of Pinocchio for the same joints, both ways, by name."""

from __future__ import annotations

import logging
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from wbc import validation
from wbc.errors import ShapeError, UnknownNameError, UnsupportedJointError
from wbc.multibody import pin, to_pin
from wbc.robot.robot import Robot, checked_robot
from wbc.robot.sources.kinds import is_mjmodel
from wbc.robot.sources.mjnames import SIZES, MjNames, names_of, pose_of
from wbc.rotations import TO_MUJOCO, TO_PINOCCHIO
from wbc.validation import Array

if TYPE_CHECKING:
    import mujoco

log = logging.getLogger("wbc")

#: Bodies are where both models say to within this [m, rad]
SAME_PLACE = 1e-6
#: Bodies weigh what both models say to within this part
ALIKE = 1e-6


class MujocoJoints:
    """Turns qpos and qvel of a MuJoCo model into q and v of a robot, and back; joints are found by their names.

        joints = MujocoJoints(model, robot)
        step = controller.step(joints.q(data.qpos))
        joints.put_q(data.qpos, robot.integrate(q, step.v, dt))

    MuJoCo's quaternions are w, x, y, z and Pinocchio's x, y, z, w; the linear velocity of a free joint is along the
    world's axes in MuJoCo and along the body's in Pinocchio, its angular velocity along the body's in both. Joints
    of the model that the robot does not have, such as those of objects, are left alone.

    When it is made, bodies of the same name are compared at a random configuration: one in another place is an error,
    one of another mass a warning in the log.

    Args:
        model: ``mujoco.MjModel``. robot: has the same joints or fewer.

    Raises:
        ShapeError: no MjModel; a body is elsewhere. UnknownNameError: a joint that the model does not have.
        UnsupportedJointError: it has it with other numbers.
    """

    def __init__(self, model: mujoco.MjModel, robot: Robot) -> None:
        if not is_mjmodel(model):
            raise ShapeError("model", model, "expected a mujoco.MjModel")
        self._robot, self._sizes = checked_robot(robot), (int(model.nq), int(model.nv))
        #: MuJoCo's number of each joint -> that joint's first index in v
        self.columns: dict[int, int] = {}
        #: For each joint: where its numbers begin, in qpos, qvel, q and v, and how many these are there
        self._places: list[tuple[int, int, int, int, int, int]] = []
        names = names_of(model)
        numbers = {name: j for j, name in enumerate(names.joints)}
        for k, name in enumerate(robot.joint_names, start=1):
            self._add(model, k, name, numbers)
        # Numbers that are copied, all at once; then what differs
        plain = [(at, start, nq) for at, _, start, _, nq, _ in self._places if nq != 2]
        self._from_qpos, self._to_q = (_spans([(one[k], one[2]) for one in plain]) for k in (0, 1))
        for start, nq in ((start, nq) for _, start, nq in plain if nq in (4, 7)):
            row = int(np.flatnonzero(self._to_q == start + nq - 4)[0])
            self._from_qpos[row : row + 4] = self._from_qpos[row : row + 4][TO_PINOCCHIO]
        pairs = [(dof, column, nv) for _, dof, _, column, _, nv in self._places]
        self._from_qvel, self._to_v = (_spans([(one[k], one[2]) for one in pairs]) for k in (0, 1))
        self._endless = [(at, start) for at, _, start, _, nq, _ in self._places if nq == 2]
        self._free = [(at, column) for at, _, _, column, nq, _ in self._places if nq == 7]
        self._compare(model, names)

    def _add(self, model: mujoco.MjModel, k: int, name: str, numbers: dict[str, int]) -> None:
        pins = int(self._robot.model.nqs[k]), int(self._robot.model.nvs[k])
        start, column = int(self._robot.model.idx_qs[k]), int(self._robot.model.idx_vs[k])
        if name not in numbers:
            raise UnknownNameError("robot.joint_names", name, numbers)
        j = numbers[name]
        nq, nv = SIZES[int(model.jnt_type[j])]
        if pins != (nq, nv) and not (pins == (2, 1) and nq == 1):
            raise UnsupportedJointError("model", name, f"it has {(nq, nv)} numbers, the robot's joint {pins}")
        self._places.append((int(model.jnt_qposadr[j]), int(model.jnt_dofadr[j]), start, column, pins[0], nv))
        self.columns[j] = column

    def _compare(self, model: mujoco.MjModel, names: MjNames) -> None:
        """Bodies at a random configuration, each seen from the first so that the robot may stand elsewhere."""
        import mujoco

        robot, data = self._robot, mujoco.MjData(model)
        self.put_q(data.qpos, robot.random(0))
        mujoco.mj_kinematics(model, data)
        pinocchio, where = robot.model, robot.model.createData()
        pin.framesForwardKinematics(pinocchio, where, self.q(data.qpos))
        first: tuple[pin.SE3, pin.SE3] | None = None
        moved = self._elsewhere(model)
        for b in range(1, model.nbody):
            name = names.bodies[b]
            if b in moved or not pinocchio.existFrame(name, pin.FrameType.BODY):
                continue
            index = pinocchio.getFrameId(name, pin.FrameType.BODY)
            ours, theirs = where.oMf[index].copy(), to_pin(pose_of(data.xpos[b], data.xquat[b]))
            first = first or (ours, theirs)
            gap = np.abs(pin.log6(first[0].actInv(ours).actInv(first[1].actInv(theirs))).vector).max()
            if gap > SAME_PLACE * max(1.0, float(np.linalg.norm(ours.translation))):
                what = f"body {name!r} is {gap:.3g} m or rad from where the model has it, seen from the first body"
                raise ShapeError("robot", robot.name, f"it is another robot than the model's: {what}")
        masses = float(sum(i.mass for i in list(pinocchio.inertias)[1:])), self._mass(model)
        if abs(masses[0] - masses[1]) > ALIKE * max(masses):
            log.warning("%s weighs %.6g kg, and %.6g kg in the MuJoCo model", robot.name, *masses)

    def _elsewhere(self, model: mujoco.MjModel) -> set[int]:
        """Bodies that the robot says nothing of: moved by a program, or by joints that it has not or has locked."""
        out = {b for b in range(1, model.nbody) if model.body_mocapid[b] >= 0}
        for b in range(1, model.nbody):
            own = range(int(model.body_jntadr[b]), int(model.body_jntadr[b]) + int(model.body_jntnum[b]))
            if int(model.body_parentid[b]) in out or not self.columns.keys() >= set(own):
                out.add(b)
        return out

    def _mass(self, model: mujoco.MjModel) -> float:
        """Of what the robot's joints carry."""
        carried, total = {int(model.jnt_bodyid[j]) for j in self.columns}, 0.0
        for b in range(1, model.nbody):
            if int(model.body_parentid[b]) in carried:
                carried.add(b)
            total += float(model.body_mass[b]) if b in carried else 0.0
        return total

    def q(self, qpos: Any) -> Array:
        """The configuration ``[nq]`` in a model's qpos.

        Raises:
            ShapeError: another number of numbers.
        """
        here, q = self._checked("qpos", qpos, 0), np.empty(self._robot.nq)
        q[self._to_q] = here[self._from_qpos]
        for at, start in self._endless:
            q[start : start + 2] = np.cos(here[at]), np.sin(here[at])
        return q

    def v(self, qpos: Any, qvel: Any) -> Array:
        """The velocity ``[nv]`` in a model's qvel; qpos tells how a free body is turned.

        Raises:
            ShapeError: another number of numbers.
        """
        here, rates, v = self._checked("qpos", qpos, 0), self._checked("qvel", qvel, 1), np.empty(self._robot.nv)
        v[self._to_v] = rates[self._from_qvel]
        for at, column in self._free:
            v[column : column + 3] = _rotation(here[at + 3 : at + 7]).T @ v[column : column + 3]
        return v

    def put_q(self, qpos: Array, q: Any) -> None:
        """Write a configuration into a model's qpos; other joints keep their numbers.

        Raises:
            ShapeError, NotFiniteError, RotationError: no configuration, or no qpos.
        """
        self._checked("qpos", qpos, 0)
        q = self._robot.configuration("q", q)
        for at, _, start, _, nq, _ in self._places:
            if nq == 2:
                qpos[at] = np.arctan2(q[start + 1], q[start])
                continue
            qpos[at : at + nq] = q[start : start + nq]
            if nq in (4, 7):
                qpos[at + nq - 4 : at + nq] = q[start + nq - 4 : start + nq][TO_MUJOCO]

    def put_v(self, qvel: Array, q: Any, v: Any) -> None:
        """Write a velocity at a configuration into a model's qvel; other joints keep their numbers.

        Raises:
            ShapeError, NotFiniteError, RotationError: no configuration, velocity or qvel.
        """
        self._checked("qvel", qvel, 1)
        q, v = self._robot.configuration("q", q), validation.real_array("v", v, (self._robot.nv,))
        for _, dof, start, column, nq, nv in self._places:
            qvel[dof : dof + nv] = v[column : column + nv]
            if nq == 7:
                turn = pin.Quaternion(q[start + 3 : start + 7]).toRotationMatrix()
                qvel[dof : dof + 3] = turn @ v[column : column + 3]

    def _checked(self, name: str, numbers: Any, which: int) -> Array:
        if np.shape(numbers) != (self._sizes[which],):
            raise ShapeError(name, numbers, f"expected {self._sizes[which]} numbers, as the model has")
        return np.asarray(numbers)


def _spans(spans: list[tuple[int, int]]) -> NDArray[np.intp]:
    """Indices of (first, count)s, one after the other."""
    return np.array([first + k for first, count in spans for k in range(count)], dtype=np.intp)


def _rotation(quaternion: Array) -> Array:
    """Of w, x, y, z."""
    w, x, y, z = quaternion.tolist()
    return np.asarray(pin.Quaternion(w, x, y, z).toRotationMatrix())
