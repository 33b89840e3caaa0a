"""What a retargeted motion is written as: arrays, tables, MuJoCo's keyframes, logs, and what learners load."""

from __future__ import annotations

import csv
import os
import pathlib
import pickle
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any
from xml.sax.saxutils import quoteattr

import numpy as np

import wbc.log
from wbc import extras, validation
from wbc.errors import ClipFileError, RangeError, ShapeError
from wbc.log import Log
from wbc.log.lerobot import write_lerobot_dataset
from wbc.robot.joint_values import joint_values
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


def joint_columns(motion: Retargeted, joints: Sequence[str] | None = None) -> tuple[tuple[str, ...], Array]:
    """Names of joints, and root (x, y, z, quaternion x, y, z, w) and joints side by side [frames, 7 + joints] [m, rad].

    Of joints one that turns without end has its angle, a ball joint its rotation vector; ``joints``: their order, or
    fewer of them, by default the robot's degrees of freedom.
    """
    robot, q = motion.robot, validation.ordinary_array("motion.q", motion.q)
    first = robot.base_nv
    root = q[:, :7] if first else np.tile([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0], (len(q), 1))
    names, positions = robot.dof_names[first:], joint_values(robot, q)
    chosen = names if joints is None else tuple(validation.one_of("joints", name, names) for name in joints)
    return chosen, np.column_stack((root, positions[:, [names.index(name) for name in chosen]]))


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
    names, table = joint_columns(motion, joints)
    if kind == "log":
        return wbc.log.save(log_of(motion), path.parent, "npz", path.stem)
    parts: dict[str, Any] = {"root_pos": table[:, :3], "root_rot": table[:, 3:7], "dof_pos": table[:, 7:]}
    rate, stance = motion.rate, {f"stance.{limb}": np.asarray(stands) for limb, stands in motion.stance.items()}
    with validation.replacing("file", path, ClipFileError) as fresh:
        path.parent.mkdir(parents=True, exist_ok=True)
        if kind == "csv-plain":
            np.savetxt(fresh, table, fmt="%.9g", delimiter=",")
        elif kind == "keyframes":
            fresh.write_text(_keyframes(motion, model), encoding="utf-8")
        elif kind == "csv":
            rows = [["time", *ROOT, *names], *np.column_stack((motion.time, table)).tolist()]
            with fresh.open("w", newline="", encoding="utf-8") as stream:
                csv.writer(stream).writerows(rows)
        elif kind == "gmr":
            parts |= {"fps": round(rate) if abs(round(rate) - rate) < 1e-6 else rate, "joint_names": list(names)}
            fresh.write_bytes(pickle.dumps(parts | dict.fromkeys(("local_body_pos", "link_body_list"))))
        else:
            parts |= {"q": motion.q, "time": motion.time, "rate": rate, "robot": motion.robot.name, **stance}
            with fresh.open("wb") as stream:
                np.savez_compressed(stream, allow_pickle=False, joint_names=names, **parts)
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
    columns = [joint_columns(motion) for motion in motions]
    for number, motion in enumerate(motions):
        if columns[number][0] != columns[0][0] or abs(motion.rate - motions[0].rate) > 1e-6:
            raise RangeError(f"motions[{number}]", motion.robot.name, "a dataset has one robot and one rate")
    if not motions or abs((rate := round(motions[0].rate)) - motions[0].rate) > 1e-6:
        raise RangeError("motions", motions, "expected a motion at least, and a whole number of frames a second")
    if path.exists():
        raise ClipFileError("folder", str(path), "is there already")
    episodes = [{"observation.state": q, "action": np.concatenate([q[1:], q[-1:]])} for _, q in columns]
    names = dict.fromkeys(("observation.state", "action"), (*ROOT, *columns[0][0]))
    with validation.writing("folder", path, ClipFileError):
        path.mkdir(parents=True)
        write_lerobot_dataset(path, motions[0].robot.name, rate, names, episodes, words)
    return path
