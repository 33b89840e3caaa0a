"""The log of a walk: what every tick was, the holds and when they were there; kept as ``run.npz``."""

from __future__ import annotations

import json
import os
import pathlib
import zipfile
from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wbc import validation
from wbc.errors import NotFiniteError, RangeError, RotationError, ShapeError
from wbc.validation import Array
from wbc.walking.log.part import FILE as FILE
from wbc.walking.log.part import PART, read_part
from wbc.walking.log.part import WalkLogError as WalkLogError
from wbc.walking.log.ticks import TICK

Integers = NDArray[np.int64]
Flags = NDArray[np.bool_]

FORMAT = 1
#: What a hand does; the log has the index. A hand holds only while it is closed
HAND_STATES = ("open", "closing", "closed", "opening")
OPEN, CLOSING, CLOSED, OPENING = range(4)
#: What the command was; the log has the index. A twist has six numbers, a pose seven
COMMANDS = ("none", "twist", "pose")
#: Entries of ``meta`` that every log has, and their types
META: Mapping[str, type | tuple[type, ...]] = {
    "robot": str,
    "robot_digest": str,
    "structure": str,
    "structure_digest": str,
    "dt": float,
    "seed": int,
    "versions": dict,
}
_FORMAT = "format"


#: Fields with a row a tick, in the order in which ``run.part`` has them
ROW = (
    *("t", "pose_body_in_structure", "q", "v", "twist_body", "hand_state", "hand_hold", "body_fixed"),
    *("command", "command_kind"),
)
#: When a hold was there, in ``run.part``
PRESENCE = np.dtype([("presence_hold", "i8"), ("presence_span", "f8", 2)])


def row_dtype(joints: int, arms: int) -> np.dtype[Any]:
    """A row of a log with so many joints and arms: its fields :data:`ROW`."""
    sizes: list[Any] = [("f8",), ("f8", (7,)), ("f8", (joints,)), ("f8", (joints,)), ("f8", (6,))]
    sizes += [("i8", (arms,)), ("i8", (arms,)), ("?",), ("f8", (7,)), ("i8",)]
    return np.dtype([(name, *size) for name, size in zip(ROW, sizes, strict=True)])


@dataclass(frozen=True, eq=False)
class WalkLog:
    """A walk as recorded: n ticks of a machine with a arms and m joints on h holds. SI; poses are position and unit
    quaternion (x, y, z, w) in the structure's frame. Arrays are read-only.

    Attributes:
        joints: names of the joints [m]. arms: names of the arms [a]. hands: the URDF's links that grasp [a].
        t: [n] s.
        pose_body_in_structure: of the URDF's root link, [n, 7].
        q: joint angles [n, m]. v: joint rates [n, m]; those of tick k last until tick k + 1.
        twist_body: linear and angular velocity of the body along the body's axes, [n, 6]; lasts like ``v``.
        hand_state: [n, a] indices into :data:`HAND_STATES`.
        hand_hold: [n, a] rows of the holds' table: what a hand holds, closes on or opens from, what an open hand
            swings to; -1 none.
        body_fixed: [n] whether the body is declared fixed, before enough hands hold.
        command: [n, 7] and command_kind: [n], an index into :data:`COMMANDS`; numbers beyond the kind's are 0.
        hold_id: [h]. hold_pose: [h, 7]. hold_roll: [h], 0 free, 1 fixed, n n-fold. hold_max_tilt: [h] rad.
        presence_hold: [p] and presence_span: [p, 2]: the hold is there for span[0] <= t < span[1]; inf for ever.
        meta: plain data; :data:`META` says what must be there.

    Raises:
        ShapeError, NotFiniteError, RangeError, RotationError: a field of another shape or with a value it cannot
            have; the message names the field and the value.
    """

    joints: tuple[str, ...]
    arms: tuple[str, ...]
    hands: tuple[str, ...]
    t: Array
    pose_body_in_structure: Array
    q: Array
    v: Array
    twist_body: Array
    hand_state: Integers
    hand_hold: Integers
    body_fixed: Flags
    command: Array
    command_kind: Integers
    hold_id: tuple[str, ...]
    hold_pose: Array
    hold_roll: Integers
    hold_max_tilt: Array
    presence_hold: Integers
    presence_span: Array
    meta: Mapping[str, Any]

    def __post_init__(self) -> None:
        for name in ("joints", "arms", "hands", "hold_id"):
            object.__setattr__(self, name, _names(name, getattr(self, name)))
        if len(self.hands) != len(self.arms):
            raise ShapeError("WalkLog.hands", self.hands, f"expected {len(self.arms)}, one an arm")
        n, m, a, h = len(np.atleast_1d(self.t)), len(self.joints), len(self.arms), len(self.hold_id)
        p = len(np.atleast_1d(self.presence_hold))
        if n < 2:
            raise ShapeError("WalkLog.t", self.t, "expected at least two ticks")
        reals = {"t": (n,), "pose_body_in_structure": (n, 7), "q": (n, m), "v": (n, m), "twist_body": (n, 6)}
        reals |= {"command": (n, 7), "hold_pose": (h, 7), "hold_max_tilt": (h,)}
        for name, shape in reals.items():
            self._set(name, validation.real_array(f"WalkLog.{name}", getattr(self, name), shape))
        for name in ("pose_body_in_structure", "hold_pose"):
            _check_quaternions(name, getattr(self, name))
        _check_least("hold_max_tilt", self.hold_max_tilt, 0.0)
        whole = {"hand_state": ((n, a), 0, 3), "hand_hold": ((n, a), -1, h - 1), "command_kind": ((n,), 0, 2)}
        whole |= {"hold_roll": ((h,), 0, 2**31), "presence_hold": ((p,), 0, h - 1), "body_fixed": ((n,), 0, 1)}
        for name, (shape, low, high) in whole.items():
            self._set(name, _integers(name, getattr(self, name), shape, low, high))
        self._set("body_fixed", self.body_fixed.astype(bool))
        span = validation.real_array("WalkLog.presence_span", self.presence_span, (p, 2), finite=False)
        if np.isnan(span).any():
            raise NotFiniteError("WalkLog.presence_span", self.presence_span, "expected numbers, inf for no end")
        self._set("presence_span", span)
        object.__setattr__(self, "meta", _meta(self.meta))

    def __len__(self) -> int:
        return len(self.t)

    @property
    def dt(self) -> float:
        """The time between ticks that ``meta`` states [s]."""
        return float(self.meta["dt"])

    def present(self, hold: Any, t: Any) -> Flags:
        """Whether holds (rows of the table) are there at times ``t`` [s]; False for -1. Arrays broadcast."""
        rows, times = np.broadcast_arrays(np.asarray(hold), np.asarray(t, dtype=float))
        out = np.zeros(rows.shape, dtype=bool)
        # Of hundreds of holds hands are at a few
        asked = np.isin(self.presence_hold, np.unique(rows))
        for row, (start, end) in zip(self.presence_hold[asked], self.presence_span[asked], strict=True):
            out |= (rows == row) & (times >= start) & (times < end)
        return out

    def save(self, path: str | os.PathLike[str]) -> pathlib.Path:
        """Writes the log, whole or not at all; returns the file.

        Args:
            path: the file, or a folder, which gets ``run.npz``.

        Raises:
            WalkLogError: the file cannot be written.
        """
        file = pathlib.Path(path)
        file = file / FILE if file.is_dir() else file
        arrays: dict[str, Any] = {f.name: np.array(getattr(self, f.name)) for f in fields(self) if f.name != "meta"}
        arrays |= {"meta": np.array(json.dumps(dict(self.meta))), _FORMAT: np.array(FORMAT)}
        # Written beside its place and renamed into it, so that no reader ever meets half a file
        fresh = file.with_name(f".{file.name}")
        try:
            with fresh.open("wb") as stream:
                np.savez_compressed(stream, allow_pickle=False, **arrays)
            fresh.replace(file)
        except OSError as error:
            raise WalkLogError("path", str(path), f"cannot be written: {error.strerror}") from error
        return file

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> WalkLog:
        """The log in a file, or in a run's folder: of a run that was killed as far as it was written, ``run.part``.

        Raises:
            WalkLogError: no such file, no log of a walk, another format, or a field that is missing.
            ShapeError, NotFiniteError, RangeError, RotationError: a field that cannot be; the message names it.
        """
        file = pathlib.Path(path)
        if file.is_dir():
            if not (file / FILE).is_file() and (file / PART).is_file():
                return cls(**_from_part(file / PART))
            file = file / FILE
        if not file.is_file():
            raise WalkLogError(
                "run", str(path), f"there is no {FILE}" if file.name == FILE else "there is no such file"
            )
        try:
            with np.load(file, allow_pickle=False) as data:
                read = {name: data[name] for name in data.files}
        except (OSError, ValueError, EOFError, KeyError, zipfile.BadZipFile) as error:
            raise WalkLogError("run", str(path), f"no log of a walk: {error}") from error
        if _FORMAT not in read or read[_FORMAT].shape != () or read[_FORMAT] != FORMAT:
            raise WalkLogError(
                "run.format",
                read.get(_FORMAT, "none"),
                f"no log of a walk of format {FORMAT}, which this version reads",
            )
        missing = [f.name for f in fields(cls) if f.name not in read]
        if missing:
            raise WalkLogError(f"run.{missing[0]}", str(path), "the file lacks this field")
        try:
            read["meta"] = json.loads(str(read["meta"]))
        except ValueError as error:
            raise WalkLogError("run.meta", str(read["meta"]), f"no JSON: {error}") from error
        return cls(**{f.name: read[f.name] for f in fields(cls)})

    def _set(self, name: str, array: NDArray[Any]) -> None:
        array.flags.writeable = False
        object.__setattr__(self, name, array)


def _from_part(file: pathlib.Path) -> dict[str, Any]:
    """The fields of a log out of what was written while walking.

    Raises:
        WalkLogError: nothing was, or something else.
    """
    arrays = read_part(file)
    if not arrays:
        raise WalkLogError("run", str(file.parent), "the run was ended before it walked")
    try:
        text = json.loads(str(arrays[0]))
        if text["format"] != FORMAT:
            raise WalkLogError("run.format", text["format"], f"this version reads format {FORMAT}")
        dtype, presence = row_dtype(len(text["joints"]), len(text["arms"])), np.zeros(0, PRESENCE)
        rows, ticks = [np.zeros(0, dtype)], 0
        for array in arrays[2:]:
            if array.dtype == dtype:
                rows.append(array)
            elif array.dtype == TICK:
                ticks += len(array)
            else:
                presence = array
        whole = np.concatenate(rows)[:ticks]
        if len(whole) < 2:
            raise WalkLogError("run", str(file.parent), "the run was ended before its first ticks were written")
        out: dict[str, Any] = {name: np.ascontiguousarray(whole[name]) for name in ROW}
        out |= {name: np.array(arrays[1][name]) for name in ("hold_id", "hold_pose", "hold_roll", "hold_max_tilt")}
        out |= {name: np.array(presence[name]) for name in ("presence_hold", "presence_span")}
        names = {name: tuple(text[name]) for name in ("joints", "arms", "hands")}
        return {**names, **out, "meta": text["meta"]}
    except WalkLogError:
        raise
    except (IndexError, KeyError, TypeError, ValueError) as error:
        raise WalkLogError("run", str(file), f"no log of a walk: {error}") from error


def _names(name: str, value: Any) -> tuple[str, ...]:
    if isinstance(value, str):
        raise ShapeError(f"WalkLog.{name}", value, "expected several names, not one text")
    array = np.asarray(value)
    if array.ndim != 1 or not len(array) or array.dtype.kind != "U":
        raise ShapeError(f"WalkLog.{name}", value, "expected names")
    names = tuple(str(x) for x in array)
    if len(set(names)) != len(names):
        raise ShapeError(f"WalkLog.{name}", names, "expected each name once")
    return names


def _integers(name: str, value: Any, shape: tuple[int, ...], low: int, high: int) -> Integers:
    array = np.asarray(value)
    if array.dtype.kind not in "iub":
        raise ShapeError(f"WalkLog.{name}", value, "expected whole numbers")
    out = np.array(array, dtype=np.int64)
    if out.shape != shape:
        raise ShapeError(f"WalkLog.{name}", value, f"expected shape {shape}, not {out.shape}")
    bad = np.argwhere((out < low) | (out > high))
    if len(bad):
        place = tuple(int(i) for i in bad[0])
        raise RangeError(f"WalkLog.{name}{list(place)}", int(out[place]), f"expected a number within {low} to {high}")
    return out


def _check_quaternions(name: str, poses: Array) -> None:
    off = np.abs(np.linalg.norm(poses[:, 3:], axis=1) - 1.0)
    if off.max() > validation.ROTATION_TOLERANCE:
        k = int(off.argmax())
        raise RotationError(f"WalkLog.{name}[{k}]", poses[k].tolist(), "expected a quaternion x, y, z, w of norm 1")


def _check_least(name: str, values: Array, least: float) -> None:
    if values.min() < least:
        k = int(values.argmin())
        raise RangeError(f"WalkLog.{name}[{k}]", float(values[k]), f"expected a value of at least {least:g}")


def _meta(value: Any) -> dict[str, Any]:
    if not isinstance(value, Mapping):
        raise ShapeError("WalkLog.meta", value, f"expected a mapping with {', '.join(META)}")
    out = dict(value)
    for name, kind in META.items():
        if name not in out:
            raise ShapeError(f"WalkLog.meta.{name}", sorted(out), "this entry is missing")
        if not isinstance(out[name], kind) or isinstance(out[name], bool):
            raise ShapeError(f"WalkLog.meta.{name}", out[name], f"expected {getattr(kind, '__name__', kind)}")
    validation.scalar("WalkLog.meta.dt", out["dt"], low=0.0, open_low=True, unit="s")
    try:
        json.dumps(out)
    except (TypeError, ValueError) as error:
        raise ShapeError("WalkLog.meta", out, f"expected plain data: {error}") from error
    return out
