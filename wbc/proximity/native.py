"""Distances and rows of the closest pairs in C: one call from the configuration to the rows."""

from __future__ import annotations

import ctypes
import functools
from pathlib import Path

import numpy as np

from wbc.geometry.kernel import HEADERS, ShapeTable, Tolerance, checked
from wbc.multibody import pin
from wbc.native.kernel import kernel
from wbc.native.library import load_library
from wbc.native.structures import CStructures
from wbc.proximity.corners import NEAR
from wbc.proximity.rows import PairRows
from wbc.proximity.scene import PairScene
from wbc.shapes import FAR
from wbc.symbolic.joint_steps import JointStep, joint_steps, place
from wbc.validation import Array

#: Where the C is that measures
SOURCES = Path(__file__).parent / "native"

#: A pair keeps its row until another one is closer by this share of its distance ...
KEEP_SHARE = 0.1
#: ... and by this share of the robot's characteristic length.
KEEP_LENGTH = 0.005
#: What rounding may do to bounds, in the same parts.
OFF = 1e-12

_SceneStruct = CStructures(SOURCES / "scene.h", HEADERS / "shapes.h").structure("scene_t")


@functools.cache
def library() -> ctypes.PyDLL:
    """The compiled sensor.

    Raises:
        CompileError: as of :func:`wbc.geometry.kernel.library`.
    """
    found = checked(load_library(kernel(SOURCES / "sensor.c", HEADERS)), wbc_scene_size=_SceneStruct)
    at = ctypes.c_void_p
    for name in ("wbc_sense", "wbc_measure"):
        getattr(found, name).argtypes = [at, at]
        getattr(found, name).restype = None
    found.wbc_missing.argtypes, found.wbc_missing.restype = [at, at, at, ctypes.c_double, at], ctypes.c_int
    return found


class Sensing:
    """A scene, its rows and their memory.

    Attributes:
        pairs: number of the pair of each row, -1 without.
        distances, normals, points, doubtful: of every pair at its last measurement.
        urgent: which pairs come before others, see :mod:`wbc.proximity.missing`.
        addresses: of ``wbc_sense``, of ``wbc_missing``, and of what they work on.
    """

    def __init__(self, scene: PairScene, rows: PairRows | None = None) -> None:
        functions = library()
        length = scene.robot.characteristic_length
        how = Tolerance.of(length)
        count, pairs = (0 if rows is None else rows.count), len(scene.first)
        self._q, self._pose = np.zeros(scene.robot.nq), np.zeros(12)
        self._answer, self._doubtful = np.zeros((pairs, 7)), np.zeros(pairs, dtype=np.int8)
        self.pairs = np.full(count, -1, dtype=np.int32)
        self._near, self._has_row = np.zeros(count, dtype=np.int8), np.zeros(pairs, dtype=np.int8)
        self.urgent = np.zeros(pairs, dtype=np.int8)
        arrays = _kinematics(scene) | _bodies(scene) | {
            "answer": self._answer, "doubtful": self._doubtful, "row_pair": self.pairs,
            "first": scene.first.astype(np.int32), "second": scene.second.astype(np.int32), "outward": scene.outward,
            "has_row": self._has_row, "is_measured": np.zeros(pairs, dtype=np.int8), "urgent": self.urgent,
            "score": np.zeros(pairs), "least": np.zeros(pairs), "heap": np.zeros(max(count, 1), dtype=np.int32),
            "row_near": self._near, "row_fresh": np.zeros(count, dtype=np.int8), "pose": self._pose,
        }  # fmt: skip
        if rows is not None:
            names = ("distance", "drift", "line", "side", "pair_side", "most", "margin", "rate", "pose", "velocity")
            arrays |= {name: getattr(rows, name) for name in names if getattr(rows, name) is not None}
        # Held, since the structure has their addresses only
        self._table = ShapeTable([body.shape for body in scene.bodies])
        self._arrays = {name: np.ascontiguousarray(array) for name, array in arrays.items()}
        assert rows is None or all(self._arrays[n] is arrays[n] for n in ("distance", "drift", "line", "side"))
        self._scene = _SceneStruct(
            joints=scene.robot.model.njoints, steps=len(arrays["step_q"]), bodies=len(scene.bodies), pairs=pairs,
            rows=count, corners=0 if rows is None else rows.corners, width=arrays["corner"].shape[1],
            nv=scene.robot.nv, has_pose=bool(scene.moving.any()), has_velocity="velocity" in arrays, far=FAR,
            how=(how.touch, how.tie, how.trust), shape=self._table.address, keep_share=KEEP_SHARE,
            keep_length=KEEP_LENGTH * length, off=OFF * length, near=NEAR * length,
            **{name: array.ctypes.data for name, array in self._arrays.items()},
        )  # fmt: skip
        self._at = ctypes.c_void_p(ctypes.addressof(self._scene))
        self._sense, self._measure, self._missing = functions.wbc_sense, functions.wbc_measure, functions.wbc_missing
        in_c = (ctypes.cast(function, ctypes.c_void_p).value or 0 for function in (self._sense, self._missing))
        self.addresses = (*in_c, ctypes.addressof(self._scene))
        self.distances, self.normals, self.points = self._answer[:, 0], self._answer[:, 1:4], self._answer[:, 4:]

    @property
    def doubtful(self) -> np.ndarray:
        """Whether the normal of a pair is a declared one."""
        return self._doubtful.astype(bool)

    @property
    def measured(self) -> int:
        """How many pairs the last call measured."""
        return int(self._scene.measured)

    def reset(self) -> None:
        """Forget the rows."""
        self.pairs[:] = -1
        self._has_row[:] = self._near[:] = self.urgent[:] = 0

    def sense(self, q: Array) -> None:
        """Measure and write the rows."""
        self._q[:] = q
        self._sense(self._at, self._q.ctypes.data)

    def missing(self, screws: Array, v: Array, dt: float, braking: Array) -> int:
        """See :meth:`wbc.proximity.sensor.PairSensor.missing`."""
        given = [np.ascontiguousarray(x, dtype=np.float64) for x in (screws, v, braking)]
        twists, command, brakes = (x.ctypes.data for x in given)
        return int(self._missing(self._at, twists, command, dt, brakes))

    def measure(self, q: Array, pose: pin.SE3) -> None:
        """All pairs."""
        self._q[:] = q
        self._pose[:] = np.concatenate([np.asarray(pose.rotation).ravel("F"), pose.translation])
        self._measure(self._at, self._q.ctypes.data)


def _kinematics(scene: PairScene) -> dict[str, Array]:
    """Steps of the joints that bodies stand on, and of those below them."""
    model = scene.robot.model
    needed = {int(j) for joint in scene.joints for j in model.supports[joint]}
    steps: list[JointStep] = []
    begin, parent = np.zeros(model.njoints + 1, dtype=np.int32), np.full(model.njoints, -1, dtype=np.int32)
    places, poses = np.zeros((model.njoints, 12)), np.zeros((model.njoints + 1, 12))
    poses[:] = place(pin.SE3.Identity())
    for joint in range(1, model.njoints):
        if joint in needed:
            steps += joint_steps(model, joint)
            parent[joint] = int(model.parents[joint])
            places[joint] = place(model.jointPlacements[joint])
        begin[joint + 1] = len(steps)
    return {
        "joint_parent": parent,
        "joint_steps": begin,
        "joint_place": places,
        "joint_pose": poses,
        "joint_v": np.array([list(model.idx_vs), list(model.nvs)], dtype=np.int32).T,
        "joint_twist": np.zeros((model.njoints + 1, 6)),
        "step_kind": np.array([step.kind for step in steps], dtype=np.int32),
        "step_q": np.array([step.q for step in steps], dtype=np.int32),
        "step_number": np.array([step.numbers for step in steps]).reshape(-1, 12),
    }


def _bodies(scene: PairScene) -> dict[str, Array]:
    count, corners = len(scene.bodies), [body.shape.row_corners() for body in scene.bodies]
    corner = np.zeros((count, max(1, *(len(points) for points in corners)), 3))
    for k, points in enumerate(corners):
        corner[k, : len(points)] = points
    outside = scene.robot.model.njoints
    joints = [outside if moves else joint for joint, moves in zip(scene.joints, scene.moving, strict=True)]
    return {
        "body_joint": np.array(joints, dtype=np.int32),
        "body_place": np.array([place(pose) for pose in scene.places]),
        "body_pose": np.zeros((count, 12)),
        "speed": np.zeros(count),
        "corner": corner,
        "corner_count": np.array([len(points) for points in corners], dtype=np.int32),
    }
