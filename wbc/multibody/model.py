"""A tree of joints and bodies with the attributes of ``pin.Model`` that this package and its users read."""

from __future__ import annotations

import copy
from enum import IntEnum, IntFlag
from typing import Any

import numpy as np

from wbc.multibody.joints import JointModel
from wbc.multibody.rotations import Array
from wbc.multibody.spatial import SE3, Copied, Inertia, LikePinocchio, SpatialMotion, shallow

#: Standard gravity, upwards [m/s^2], which a model has that says nothing else
GRAVITY = -9.81

#: Arrays of a model that have a number for each number in v, and what a joint without limits has there
OF_DOFS = {
    "armature": 0.0,
    "damping": 0.0,
    "lowerDryFrictionLimit": 0.0,
    "lowerEffortLimit": -np.inf,
    "lowerVelocityLimit": -np.inf,
    "rotorGearRatio": 1.0,
    "rotorInertia": 0.0,
    "upperDryFrictionLimit": 0.0,
    "upperEffortLimit": np.inf,
    "upperVelocityLimit": np.inf,
}
#: The same for each number in q
OF_COORDINATES = {"lowerPositionLimit": -np.inf, "positionLimitMargin": 0.0, "upperPositionLimit": np.inf}


class FrameType(IntFlag):
    """What a frame is; numbers as Pinocchio's."""

    OP_FRAME = 1
    JOINT = 2
    FIXED_JOINT = 4
    BODY = 8
    SENSOR = 16


class ReferenceFrame(IntEnum):
    """Where and along which axes a twist is stated; numbers as Pinocchio's."""

    WORLD = 0
    LOCAL = 1
    LOCAL_WORLD_ALIGNED = 2


_ANY = ~FrameType(0)


class FrameOnJoint(Copied):
    """A named placement on the body of a joint.

    ``FrameOnJoint(name, joint, frame it hangs on, placement, type, inertia)``, or without the frame that it hangs on.
    """

    def __init__(self, name: str, joint: int, *rest: Any) -> None:
        above, placement, kind, *inertia = rest if not isinstance(rest[0], SE3) else (0, *rest)
        self.name, self.parentJoint, self.parentFrame = str(name), int(joint), int(above)
        self.placement, self.type = SE3(placement), FrameType(kind)
        self.inertia = Inertia(*inertia)

    def copy(self) -> FrameOnJoint:
        """A frame of its own."""
        out = shallow(self)
        out.placement, out.inertia = self.placement.copy(), self.inertia.copy()
        return out

    def __eq__(self, other: object) -> bool:
        return isinstance(other, FrameOnJoint) and vars(self) == vars(other)

    __hash__ = None  # type: ignore[assignment]  # as it can be changed


class Model(LikePinocchio):
    """Joints 1 to njoints - 1 in the order in which they were added, on the universe, joint 0; a copy of a model."""

    lowerPositionLimit: Array
    positionLimitMargin: Array
    upperPositionLimit: Array
    armature: Array
    damping: Array
    lowerDryFrictionLimit: Array
    lowerEffortLimit: Array
    lowerVelocityLimit: Array
    rotorGearRatio: Array
    rotorInertia: Array
    upperDryFrictionLimit: Array
    upperEffortLimit: Array
    upperVelocityLimit: Array

    def __init__(self, other: Model | None = None) -> None:
        if other is not None:
            vars(self).update({key: _copied(value) for key, value in vars(other).items()})
            return
        self.name = ""
        self.nq = self.nv = 0
        self.names, self.parents, self.joints = ["universe"], [0], [JointModel()]
        self.idx_qs, self.nqs, self.idx_vs, self.nvs = [0], [0], [0], [0]
        self.jointPlacements, self.inertias = [SE3()], [Inertia()]
        self.frames = [FrameOnJoint("universe", 0, 0, SE3(), FrameType.FIXED_JOINT)]
        self.gravity = SpatialMotion([0.0, 0.0, GRAVITY, 0.0, 0.0, 0.0])
        self.referenceConfigurations: dict[str, Array] = {}
        self.mimicking_joints: list[int] = []
        self.mimicked_joints: list[int] = []
        for key in (*OF_DOFS, *OF_COORDINATES):
            setattr(self, key, np.zeros(0))

    @property
    def njoints(self) -> int:
        """How many joints, the universe counted."""
        return len(self.joints)

    @property
    def nframes(self) -> int:
        """How many frames."""
        return len(self.frames)

    @property
    def velocityLimit(self) -> Array:
        """As ``upperVelocityLimit``."""
        return self.upperVelocityLimit

    @velocityLimit.setter
    def velocityLimit(self, value: Any) -> None:
        self.upperVelocityLimit = np.array(value, dtype=np.float64)

    @property
    def effortLimit(self) -> Array:
        """As ``upperEffortLimit``."""
        return self.upperEffortLimit

    @effortLimit.setter
    def effortLimit(self, value: Any) -> None:
        self.upperEffortLimit = np.array(value, dtype=np.float64)

    @property
    def supports(self) -> list[list[int]]:
        """Of each joint the joints from the universe to itself."""
        out = [[0]]
        for j in range(1, self.njoints):
            out.append([*out[self.parents[j]], j])
        return out

    def copy(self) -> Model:
        """A model of its own."""
        return Model(self)

    def createData(self) -> TreeData:
        """What algorithms write to."""
        return TreeData(self)

    def addJoint(
        self,
        parent: int,
        joint: JointModel,
        placement: SE3,
        name: str,
        max_effort: Any = None,
        max_velocity: Any = None,
        min_config: Any = None,
        max_config: Any = None,
    ) -> int:
        """Its number. Without limits all are infinite."""
        added = shallow(joint)
        added.id, added.idx_q, added.idx_v = self.njoints, self.nq, self.nv
        self.joints.append(added)
        self.names.append(str(name))
        self.parents.append(int(parent))
        self.jointPlacements.append(SE3(placement))
        self.inertias.append(Inertia())
        for starts, sizes, start, size in (
            (self.idx_qs, self.nqs, self.nq, added.nq),
            (self.idx_vs, self.nvs, self.nv, added.nv),
        ):
            starts.append(start)
            sizes.append(size)
        self.nq, self.nv = self.nq + added.nq, self.nv + added.nv
        given = {
            "upperEffortLimit": max_effort,
            "upperVelocityLimit": max_velocity,
            "lowerPositionLimit": min_config,
            "upperPositionLimit": max_config,
        }
        if max_effort is not None:
            given["lowerEffortLimit"] = -np.asarray(max_effort)
        if max_velocity is not None:
            given["lowerVelocityLimit"] = -np.asarray(max_velocity)
        for defaults, size in ((OF_DOFS, added.nv), (OF_COORDINATES, added.nq)):
            for key, default in defaults.items():
                before: Array = getattr(self, key)
                longer = np.empty(len(before) + size)
                longer[: len(before)], longer[len(before) :] = before, default if given.get(key) is None else given[key]
                setattr(self, key, longer)
        return added.id

    def addFrame(self, frame: FrameOnJoint, append_inertia: bool = True) -> int:
        """Its number; its inertia weighs on its joint. A frame of the same name and type stays, and has the number."""
        if self.existFrame(frame.name, frame.type):
            return self.getFrameId(frame.name, frame.type)
        self.frames.append(frame.copy())
        if append_inertia:
            moved = frame.inertia if frame.inertia.isZero() else frame.placement.act(frame.inertia)
            self.inertias[frame.parentJoint] += moved
        return self.nframes - 1

    def addJointFrame(self, joint: int, above: int = -1) -> int:
        """The number of a frame at a joint; ``above``: the frame it hangs on, by default that of the joint's parent."""
        if above < 0:
            above = self.getFrameId(self.names[self.parents[joint]], FrameType.JOINT | FrameType.FIXED_JOINT)
        return self.addFrame(FrameOnJoint(self.names[joint], joint, above, SE3(), FrameType.JOINT))

    def addBodyFrame(self, name: str, joint: int, placement: SE3 | None = None, above: int = -1) -> int:
        """The number of a frame on a joint's body; ``above``: the frame it hangs on, by default the joint's."""
        if above < 0:
            above = self.getFrameId(self.names[joint])
        return self.addFrame(FrameOnJoint(name, joint, above, SE3(placement), FrameType.BODY))

    def appendBodyToJoint(self, joint: int, inertia: Inertia, placement: SE3) -> None:
        """Adds a body that is fixed to a joint's."""
        self.inertias[joint] = self.inertias[joint] + placement.act(inertia)

    def getJointId(self, name: str) -> int:
        """The number of a joint; njoints for none."""
        return self.names.index(name) if name in self.names else self.njoints

    def existJointName(self, name: str) -> bool:
        """Whether there is such a joint."""
        return name in self.names

    def getFrameId(self, name: str, kind: int = _ANY) -> int:
        """The number of the first frame of a name and type; nframes for none."""
        return next(
            (k for k, frame in enumerate(self.frames) if frame.name == name and frame.type & kind), self.nframes
        )

    def existFrame(self, name: str, kind: int = _ANY) -> bool:
        """Whether there is such a frame."""
        return self.getFrameId(name, kind) < self.nframes

    def saveToString(self) -> str:
        """All that the model says, as text that is equal for equal models."""
        said = [self.name, *(f"{key} {getattr(self, key).tolist()}" for key in (*OF_DOFS, *OF_COORDINATES))]
        for j, joint in enumerate(self.joints):
            numbers = [joint.S.tolist(), self.jointPlacements[j].homogeneous.tolist()]
            numbers.append(self.inertias[j].toDynamicParameters().tolist())
            said.append(f"{self.names[j]} {self.parents[j]} {joint.shortname()} {numbers}")
        for frame in self.frames:
            place = frame.placement.homogeneous.tolist()
            said.append(f"{frame.name} {frame.parentJoint} {frame.parentFrame} {int(frame.type)} {place}")
        said += [f"{key} {value.tolist()}" for key, value in self.referenceConfigurations.items()]
        return "\n".join([*said, str(self.gravity.vector.tolist())])

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Model) and self.saveToString() == other.saveToString()

    __hash__ = None  # type: ignore[assignment]  # as it can be changed

    def __repr__(self) -> str:
        return f"<Model {self.name!r}: {self.njoints - 1} joints, nq {self.nq}, nv {self.nv}>"


def _copied(value: Any) -> Any:
    """As ``copy.deepcopy`` of what a model has, of which that takes three times as long."""
    if isinstance(value, list):
        return [each.copy() if isinstance(each, Copied) else copy.deepcopy(each) for each in value]
    return value.copy() if isinstance(value, np.ndarray) else copy.deepcopy(value)


class TreeData(LikePinocchio):
    """What algorithms write: placements of joints in the world ``oMi`` and in their parents ``liMi``, and of frames
    ``oMf``; twists ``v`` and accelerations ``a`` of bodies in their own axes; and results by Pinocchio's names. Arrays
    and poses are written in place, so what is held of them is that of the last state.
    """

    def __init__(self, model: Model) -> None:
        self.oMi = [SE3() for _ in model.joints]
        self.liMi = [SE3() for _ in model.joints]
        self.oMf = [SE3() for _ in model.frames]
        self.v = [SpatialMotion() for _ in model.joints]
        self.a = [SpatialMotion() for _ in model.joints]
        self.J = np.zeros((6, model.nv))
        self.M = np.zeros((model.nv, model.nv))
        self.com = [np.zeros(3)]
        self.vcom = [np.zeros(3)]
        self.mass = [0.0]
        self.hg = SpatialMotion()
        # 1 where a degree of freedom moves a body
        below = np.zeros((model.njoints, model.nv))
        for j in range(1, model.njoints):
            below[j] = below[model.parents[j]]
            below[j, model.idx_vs[j] : model.idx_vs[j] + model.nvs[j]] = 1.0
        self.moved_by = below
