"""The log of a walk: what every tick was, the holds and when they were there; kept as ``run.npz``."""

from __future__ import annotations

import json
import os
import pathlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wbc import log as logs, validation
from wbc.errors import NotFiniteError, RangeError, RotationError, ShapeError
from wbc.log import Log, LogFileError
from wbc.validation import Array
from wbc.walking.log.ticks import TICK, TickColumns

Integers = NDArray[np.int64]
Flags = NDArray[np.bool_]

FORMAT = 2
#: Names of the files in a run's folder: while it is walked, and whole
PART, FILE = "run.part", "run.npz"
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
#: Members of poses and twists in names of columns
POSE, TWIST = ("x", "y", "z", "qx", "qy", "qz", "qw"), ("vx", "vy", "vz", "wx", "wy", "wz")
#: Fields of names, which a log has in its meta
NAMES = ("joints", "arms", "hands", "hold_id")


class WalkLogError(LogFileError):
    """A log of a walk that is missing, cannot be read or written, or is of another format."""


def columns_of(joints: Sequence[str], arms: Sequence[str]) -> dict[str, dict[str, tuple[str, str]]]:
    """Field of :class:`WalkLog`, then of :class:`TickColumns` -> its columns in a :class:`wbc.log.Log`, by name with
    unit and kind of number, in the order of a row.
    """
    return {
        "t": {"t": ("s", "f8")},
        "pose_body_in_structure": {f"pose.{k}": ("m" if len(k) == 1 else "", "f8") for k in POSE},
        "q": {f"q.{joint}": ("rad", "f8") for joint in joints},
        "v": {f"v.{joint}": ("rad/s", "f8") for joint in joints},
        "twist_body": {f"twist.{k}": ("m/s" if k[0] == "v" else "rad/s", "f8") for k in TWIST},
        "hand_state": {f"hand_state.{arm}": ("", "i8") for arm in arms},
        "hand_hold": {f"hand_hold.{arm}": ("", "i8") for arm in arms},
        "body_fixed": {"body_fixed": ("", "?")},
        "command": {f"command.{k}": ("", "f8") for k in range(7)},
        "command_kind": {"command_kind": ("", "i8")},
        **{name: {name: of} for name, of in TICK.items()},
    }


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

    def columns(self, ticks: TickColumns | None = None) -> Log:
        """As columns, with what the controller said of the ticks; its tables are ``holds`` (pose, roll and largest
        tilt, h x 9) and ``presence`` (row of the hold, from, to, p x 3).
        """
        columns, units = dict[str, np.ndarray](), dict[str, str]()
        for name, parts in columns_of(self.joints, self.arms).items():
            if name in TICK and ticks is None:
                continue
            values = getattr(self, name) if ticks is None or name not in TICK else ticks.padded(name)
            for column, (part, (unit, _)) in zip(values.reshape(len(self), -1).T, parts.items(), strict=True):
                columns[part], units[part] = column, unit
        meta = {"format": FORMAT, **self.meta} | {name: list(getattr(self, name)) for name in NAMES}
        tables = {
            "holds": np.column_stack([self.hold_pose, self.hold_roll, self.hold_max_tilt]),
            "presence": np.column_stack([self.presence_hold, self.presence_span]),
        }
        return Log(columns, units, meta, tables)

    def save(self, path: str | os.PathLike[str], ticks: TickColumns | None = None) -> pathlib.Path:
        """Writes the log, whole or not at all; returns the file.

        Args:
            path: the file, or a folder, which gets ``run.npz``. ticks: what the controller said of them.

        Raises:
            LogFileError: the file cannot be written.
        """
        file = pathlib.Path(path)
        file = file / FILE if file.is_dir() else file
        return logs.save(self.columns(ticks), file.parent, "npz", file.stem)

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> WalkLog:
        """The log in a file, or in a run's folder: of a run that was killed as far as it was written, ``run.part``.

        Raises:
            LogFileError: no such file, no log of a walk, another format, or a field that is missing.
            ShapeError, NotFiniteError, RangeError, RotationError: a field that cannot be; the message names it.
        """
        log = load_columns(path)
        if len(_taken(log.columns, "t")) < 2:
            raise WalkLogError("run", str(path), "the run was ended before its first ticks were written")
        return cls.of(log)

    @classmethod
    def of(cls, log: Log) -> WalkLog:
        """From :meth:`columns`; raises as :meth:`load`."""
        meta = dict(log.meta)
        if meta.pop("format", None) != FORMAT:
            raise WalkLogError("run.format", log.meta.get("format"), f"this version reads walks of format {FORMAT}")
        found: dict[str, Any] = {}
        for name in NAMES:
            found[name] = tuple(_taken(meta, name))
            meta.pop(name)
        for name, parts in columns_of(found["joints"], found["arms"]).items():
            if name not in TICK:
                columns = [_taken(log.columns, part) for part in parts]
                if any(np.shape(column) != (len(log),) for column in columns):
                    raise ShapeError(f"WalkLog.{name}", columns, f"expected {len(log)} entries a column")
                found[name] = np.stack(columns, axis=1)
        for name in ("t", "body_fixed", "command_kind"):
            found[name] = found[name][:, 0]
        holds, presence = (_table(log, name, wide) for name, wide in (("holds", 9), ("presence", 3)))
        found |= {"hold_pose": holds[:, :7], "hold_roll": holds[:, 7].astype(int), "hold_max_tilt": holds[:, 8]}
        found |= {"presence_hold": presence[:, 0].astype(int), "presence_span": presence[:, 1:]}
        return cls(**found, meta=meta)

    def _set(self, name: str, value: NDArray[Any]) -> None:
        value.flags.writeable = False
        object.__setattr__(self, name, value)


def load_columns(path: str | os.PathLike[str]) -> Log:
    """The columns of a walk, of its file or folder.

    Raises:
        LogFileError: no such file, or no log.
    """
    file = pathlib.Path(path)
    if file.is_dir():
        found = [file / name for name in (FILE, PART) if (file / name).is_file()]
        if not found:
            raise WalkLogError("run", str(path), f"there is no {FILE}")
        file = found[0]
    return logs.load(file)


def _taken(found: Mapping[str, Any], name: str) -> Any:
    """An entry of a file.

    Raises:
        WalkLogError: there is none.
    """
    if name not in found:
        raise WalkLogError(f"run.{name}", sorted(found), "the log of a walk lacks this")
    return found[name]


def _table(log: Log, name: str, wide: int) -> Array:
    """A table of so many columns.

    Raises:
        WalkLogError: there is none. ShapeError, NotFiniteError: another one.
    """
    rows = validation.real_array(
        f"WalkLog.{name}", _taken(log.tables, name), (len(log.tables[name]), wide), finite=False
    )
    return rows


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
