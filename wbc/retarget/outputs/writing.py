"""A motion as one file of a format, or several as a dataset."""

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
from wbc.retarget.outputs.motion import ROOT, JointColumns

if TYPE_CHECKING:
    import mujoco

    from wbc.retarget.retargeted import Retargeted

#: Format -> suffix of its file
MOTION_FORMATS = {
    "npz": ".npz", "csv": ".csv", "csv-plain": ".csv", "gmr": ".pkl", "keyframes": ".xml", "log": ".npz",
}  # fmt: skip


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
    columns = JointColumns.of(motion)
    if joints is not None:
        columns = columns.in_order(joints)
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
    columns: dict[str, Any] = {"t": np.asarray(motion.time)}
    units = {"t": "s"}
    for k in range(robot.nq):
        name = f"q.{robot.dof_names[dofs[k]] if k in dofs else k}"
        columns[name], units[name] = motion.q[:, k].copy(), robot.dof_units[dofs[k]] if k in dofs else ""
    for limb, stands in motion.stance.items():
        columns[f"stance.{limb}"], units[f"stance.{limb}"] = np.asarray(stands), ""
    return Log(columns, units, {"robot": robot.name, "rate": motion.rate, "kind": "retargeted"})


def _write_arrays(motion: Retargeted, columns: JointColumns, file: pathlib.Path, kind: str) -> None:
    """Npz, or GMR's pickle."""
    parts: dict[str, Any] = {
        "root_pos": columns.root_position, "root_rot": columns.root_quaternion, "dof_pos": columns.positions,
    }  # fmt: skip
    with file.open("wb") as stream:
        if kind == "gmr":
            whole = round(motion.rate)
            parts["fps"] = whole if abs(whole - motion.rate) < 1e-6 else motion.rate
            parts |= {"local_body_pos": None, "link_body_list": None, "joint_names": list(columns.names)}
            pickle.dump(parts, stream)
            return
        parts |= {f"stance.{limb}": np.asarray(stands) for limb, stands in motion.stance.items()}
        parts |= {"q": motion.q, "time": motion.time, "rate": motion.rate}
        np.savez_compressed(stream, robot=motion.robot.name, joint_names=columns.names, allow_pickle=False, **parts)


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
