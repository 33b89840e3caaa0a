"""What a retargeted motion is written as: arrays, tables, MuJoCo's keyframes, logs, and what learners load."""

from __future__ import annotations

import csv
import os
import pathlib
import pickle
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any
from xml.sax.saxutils import quoteattr

import numpy as np

import wbc.log
from wbc import extras, validation
from wbc.errors import ClipFileError, RangeError, ShapeError
from wbc.log import Log
from wbc.log.lerobot import write_lerobot_dataset
from wbc.multibody import pin
from wbc.validation import Array

if TYPE_CHECKING:
    import mujoco

    from wbc.retarget.retargeted import Retargeted

#: Columns of a root in a table
ROOT = ("root.x", "root.y", "root.z", "root.qx", "root.qy", "root.qz", "root.qw")
#: Format -> suffix of its file
MOTION_FORMATS = {
    "npz": ".npz", "csv": ".csv", "csv-plain": ".csv", "gmr": ".pkl", "keyframes": ".xml", "log": ".npz",
}  # fmt: skip


@dataclass(frozen=True)
class JointColumns:
    """A motion in numbers that need no model.

    Attributes:
        root: position [m] and quaternion x, y, z, w of the base in the world [frames, 7].
        names: of the joints' degrees of freedom, in the robot's order.
        positions: of them [frames, joints] [rad, m]; a joint that turns without end by its angle, a ball joint by its
            rotation vector.
    """

    root: Array
    names: tuple[str, ...]
    positions: Array

    @property
    def table(self) -> Array:
        """Root and joints side by side [frames, 7 + joints]."""
        return np.column_stack((self.root, self.positions))

    @classmethod
    def of(cls, motion: Retargeted) -> JointColumns:
        """Those of a motion."""
        robot, q = motion.robot, validation.ordinary_array("motion.q", motion.q)
        model, first = robot.model, robot.base_nv
        root = q[:, :7] if first else np.tile([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0], (len(q), 1))
        places = robot.position_index[first:]
        turned = np.array([pin.difference(model, pin.neutral(model), row) for row in q])[:, first:]
        endless = [column - first for column, count in zip(model.idx_vs, model.nqs, strict=True) if count == 2]
        turned[:, endless] = np.unwrap(turned[:, endless], axis=0)
        return cls(root, robot.dof_names[first:], np.where(places >= 0, q[:, places], turned))

    def in_order(self, joints: Sequence[str]) -> JointColumns:
        """The same with joints in another order, or fewer.

        Raises:
            UnknownNameError: no such joint.
        """
        numbers = [self.names.index(validation.one_of("joints", name, self.names)) for name in joints]
        return replace(self, names=tuple(self.names[k] for k in numbers), positions=self.positions[:, numbers])


def write_motion(
    motion: Retargeted,
    file: str | os.PathLike[str],
    kind: str = "npz",
    *,
    joints: Sequence[str] | None = None,
    model: mujoco.MjModel | None = None,
) -> pathlib.Path:
    """Write a motion; returns the file, which is there whole or not at all.

    * ``npz``: q, time, rate, names, root and joints apart, stances.
    * ``csv``: a header, then time, root and joints of each frame, numbers as they are.
    * ``csv-plain``: root x, y, z, quaternion x, y, z, w, and joints, without a header, as Unitree's retargeted clips.
    * ``gmr``: GMR's pickle: fps, root_pos, root_rot (x, y, z, w), dof_pos, local_body_pos, link_body_list.
    * ``keyframes``: MuJoCo's keyframes, a key a frame.
    * ``log``: the log that viewer and plots read.

    Args:
        file: its suffix becomes the format's. kind: a key of :data:`MOTION_FORMATS`.
        joints: order of the joints in csv-plain and gmr, as learners' models have them; default: the robot's.
        model: of MuJoCo whose qpos keyframes have; default: one made of the robot.

    Raises:
        UnknownNameError: no such format or joint. ClipFileError: it cannot be written. MissingPackageError: keyframes
        without MuJoCo. ShapeError, UnsupportedJointError: a model whose joints are others.
    """
    validation.one_of("format", kind, MOTION_FORMATS)
    path = validation.file_path("file", file)
    path = path.with_name(path.stem + MOTION_FORMATS[kind])
    columns = JointColumns.of(motion) if joints is None else JointColumns.of(motion).in_order(joints)
    if kind == "log":
        return wbc.log.save(log_of(motion), path.parent, "npz", path.stem)
    with validation.replacing("file", path, ClipFileError) as fresh:
        path.parent.mkdir(parents=True, exist_ok=True)
        if kind == "csv-plain":
            np.savetxt(fresh, columns.table, fmt="%.9g", delimiter=",")
        elif kind == "keyframes":
            fresh.write_text(_keyframes(motion, model), encoding="utf-8")
        elif kind == "csv":
            with fresh.open("w", newline="", encoding="utf-8") as stream:
                writer, table = csv.writer(stream), np.column_stack((motion.time, columns.table))
                writer.writerow(["time", *ROOT, *columns.names])
                writer.writerows([[repr(number) for number in row] for row in table.tolist()])
        else:
            _write_arrays(motion, columns, fresh, kind)
    return path


def log_of(motion: Retargeted) -> Log:
    """The motion as a log: columns ``t``, ``q.*`` and ``stance.*``."""
    robot = motion.robot
    dofs = {int(index): dof for dof, index in enumerate(robot.position_index) if index >= 0}
    said = {k: (robot.dof_names[dofs[k]], robot.dof_units[dofs[k]]) if k in dofs else (k, "") for k in range(robot.nq)}
    columns: dict[str, Any] = {"t": motion.time} | {f"q.{name}": motion.q[:, k] for k, (name, _) in said.items()}
    units = {"t": "s"} | {f"q.{name}": unit for name, unit in said.values()}
    columns |= {f"stance.{limb}": stands for limb, stands in motion.stance.items()}
    units |= {f"stance.{limb}": "" for limb in motion.stance}
    return Log(columns, units, {"robot": robot.name, "rate": motion.rate, "kind": "retargeted"})


def _write_arrays(motion: Retargeted, columns: JointColumns, file: pathlib.Path, kind: str) -> None:
    """Npz, or GMR's pickle."""
    root, rate, names = columns.root.copy(), motion.rate, columns.names
    parts: dict[str, Any] = {"root_pos": root[:, :3], "root_rot": root[:, 3:], "dof_pos": columns.positions}
    with file.open("wb") as stream:
        if kind == "gmr":
            parts["fps"] = round(rate) if abs(round(rate) - rate) < 1e-6 else rate
            parts |= {"local_body_pos": None, "link_body_list": None, "joint_names": list(names)}
            pickle.dump(parts, stream)
            return
        parts |= {f"stance.{limb}": np.asarray(stands) for limb, stands in motion.stance.items()}
        parts |= {"q": motion.q, "time": motion.time, "rate": rate, "robot": motion.robot.name, "joint_names": names}
        np.savez_compressed(stream, allow_pickle=False, **parts)


def _keyframes(motion: Retargeted, model: mujoco.MjModel | None) -> str:
    """MuJoCo's XML of a key a frame."""
    extras.require("mujoco", "MuJoCo's keyframes")
    from wbc.robot.mujoco_joints import MujocoJoints
    from wbc.simulation import mujoco_model

    made = mujoco_model(motion.robot, drawn=False) if model is None else model
    joints, qpos = MujocoJoints(made, motion.robot), np.array(made.qpos0)
    lines = [f"<mujoco model={quoteattr(motion.robot.name or 'robot')}>", "  <keyframe>"]
    for frame, (time, q) in enumerate(zip(motion.time, motion.q, strict=True)):
        joints.put_q(qpos, q)
        numbers = " ".join(f"{number:.9g}" for number in qpos)
        lines.append(f'    <key name="frame{frame}" time="{time:.9g}" qpos="{numbers}"/>')
    return "\n".join([*lines, "  </keyframe>", "</mujoco>", ""])


def write_lerobot(
    motions: Sequence[Retargeted], folder: str | os.PathLike[str], tasks: Sequence[str] | None = None
) -> pathlib.Path:
    """A LeRobot dataset of which each motion is an episode; returns the folder.

    A frame has ``observation.state``, the root (x, y, z, quaternion x, y, z, w) and the joints by name, and ``action``,
    the state of the next frame; of the last frame its own.

    Args:
        motions: of one robot at one rate, a whole number of frames a second. folder: is not there yet.
        tasks: what each is, in words; default: ``"retargeted motion"``.

    Raises:
        MissingPackageError: pyarrow is not installed. RangeError: no motion, another robot, or another rate.
        ShapeError: another number of tasks. ClipFileError: the folder is there, or cannot be written.
    """
    extras.require("recordings", "a dataset of LeRobot")
    motions, path = validation.items("motions", motions, "motions"), validation.file_path("folder", folder)
    words = ["retargeted motion"] * len(motions) if tasks is None else list(validation.strings("tasks", tasks))
    if len(words) != len(motions):
        raise ShapeError("tasks", words, f"expected {len(motions)}, one a motion")
    columns = [JointColumns.of(motion) for motion in motions]
    for number, motion in enumerate(motions):
        if columns[number].names != columns[0].names or abs(motion.rate - motions[0].rate) > 1e-6:
            raise RangeError(f"motions[{number}]", motion.robot.name, "a dataset has one robot and one rate")
    if not motions or abs((rate := round(motions[0].rate)) - motions[0].rate) > 1e-6:
        raise RangeError("motions", motions, "expected a motion at least, and a whole number of frames a second")
    if path.exists():
        raise ClipFileError("folder", str(path), "is there already")
    states = [own.table for own in columns]
    episodes = [{"observation.state": q, "action": np.concatenate([q[1:], q[-1:]])} for q in states]
    names = dict.fromkeys(("observation.state", "action"), (*ROOT, *columns[0].names))
    with validation.writing("folder", path, ClipFileError):
        path.mkdir(parents=True)
        write_lerobot_dataset(path, motions[0].robot.name, rate, names, episodes, words)
    return path
