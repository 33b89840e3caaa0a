"""The numbers of the walker and of the two-ended arm, read from the one file that holds them."""

from __future__ import annotations

import functools
import hashlib
import json
import pathlib
import tomllib
from collections.abc import Sequence
from dataclasses import dataclass, fields
from math import pi, sin
from typing import Any, ClassVar, Self

import numpy as np

from wbc import validation
from wbc.errors import RangeError, RobotFileError, ShapeError, UnknownNameError

FILE = pathlib.Path(__file__).parent / "data" / "walker.toml"
#: Metres in an inch
INCH = 0.0254
#: Digest of the walker's data as they are published and assumed here; figures in pages hold for these
WALKER_DIGEST = "a5af269150b1"
#: Suffix of a key of the file -> factor to SI; the longest that fits counts
_UNITS = {"_deg_s": pi / 180, "_deg": pi / 180, "_in": INCH, "_m": 1.0, "_s": 1.0}
#: Fields that may be 0 or below
_SIGNED = ("elbow_limit", "shoulder_limit", "initial_posture", "elbow_offset")


@dataclass(frozen=True)
class _Numbers:
    """What both data classes do: read their numbers, check and hash them."""

    #: Numbers in a tuple
    joints: ClassVar[int]
    #: Of the file
    groups: ClassVar[tuple[str, ...]]

    def __post_init__(self) -> None:
        kind = type(self).__name__
        for f in fields(self):
            label, value, signed = f"{kind}.{f.name}", getattr(self, f.name), f.name in _SIGNED
            if "tuple" in str(f.type):
                numbers = validation.real_array(label, value, (self.joints,))
                if not signed and (numbers <= 0).any():
                    raise RangeError(label, value, "expected values > 0")
                object.__setattr__(self, f.name, tuple(numbers.tolist()))
            else:
                low = -np.inf if signed else 0.0
                object.__setattr__(self, f.name, validation.scalar(label, value, low=low, open_low=True))

    @property
    def digest(self) -> str:
        """First 12 digits of the SHA-256 of all fields, names and exact values; runs print it."""
        lines = [f"{f.name} {_exact(getattr(self, f.name))}" for f in fields(self)]
        return hashlib.sha256("\n".join(lines).encode()).hexdigest()[:12]

    def origins(self) -> dict[str, str]:
        """Field -> ``published`` or ``assumed``, as the file says, or ``changed`` where the value is not the file's."""
        groups = _read(FILE)
        out: dict[str, str] = {}
        for f in fields(self):
            group = next(name for name in self.groups if f.name in groups[name])
            same = groups[group][f.name] == getattr(self, f.name)
            out[f.name] = ("assumed" if group.endswith("assumed") else "published") if same else "changed"
        return out

    def summary(self) -> str:
        """One line for a run: the digest, and the fields that are not the file's with their values (SI)."""
        changed = [f"{k} = {getattr(self, k)}" for k, origin in self.origins().items() if origin == "changed"]
        what = f"; changed: {', '.join(changed)}" if changed else ""
        return f"{type(self).__name__} {self.digest}{what}"

    @classmethod
    def read(cls, path: Any = FILE, **changes: Any) -> Self:
        """The data of a file, with some fields changed (SI).

        Raises:
            UnknownNameError: no such field. RobotFileError: a file that cannot be read or lacks a number.
        """
        known = [f.name for f in fields(cls)]
        values = {k: v for group in cls.groups for k, v in _read(validation.file_path("path", path))[group].items()}
        for key in values:
            if key not in known:
                raise RobotFileError("data", f"{path}: {key}", "this class has no such field")
        for key in changes:
            if key not in known:
                raise UnknownNameError(cls.__name__, key, known)
        missing = [name for name in known if name not in values and name not in changes]
        if missing:
            raise RobotFileError("data", str(path), f"the file lacks {', '.join(missing)}")
        return cls(**{**values, **changes})


def data_changes(texts: Sequence[str]) -> dict[str, Any]:
    """Fields of the data from texts NAME=NUMBER or NAME=[NUMBER, ...].

    Raises:
        ShapeError: another text.
    """
    values: dict[str, Any] = {}
    for text in texts:
        name, sign, value = text.partition("=")
        try:
            read = json.loads(value if sign else "")
        except (ValueError, RecursionError) as error:
            raise ShapeError("set", text, "expected NAME=NUMBER or NAME=[NUMBER, ...]") from error
        values[name] = tuple(read) if isinstance(read, list) else read
    return values


def spaced_radius(arms: int, radius: float) -> float:
    """Body centre to arm base [m] with which arms are as far from each other as three are at ``radius``; up to three
    arms keep that:

        radius sin(pi / 3) / sin(pi / arms)
    """
    return radius * sin(pi / 3) / sin(pi / arms) if arms > 3 else radius


@dataclass(frozen=True)
class WalkerData(_Numbers):
    """Numbers of the walker in SI. Tuples have one number a joint of an arm; ``robots/data/walker.toml`` says
    which are published and which are assumed.

    Attributes:
        neck_length, shoulder_offset, upper_arm_length, forearm_length, hand_length: of an arm [m].
        position_limits: largest \\|theta_i\\| [rad].
        elbow_limit: theta3 <= this [rad]. shoulder_limit: theta2 >= -theta3/2 + this [rad].
        initial_posture: of an arm [rad]. body_height: of the body's origin above the surface [m].
        shoulder_radius: body centre to arm base [m].
        joint_rates: largest [rad/s]. acceleration_time: from rest to the full rate [s].
        neck_radius, upper_arm_radius, forearm_radius, hand_radius: of the capsules [m].
        body_half_thickness, clearance: [m].

    Raises:
        ShapeError, NotFiniteError, RangeError: a field that is no number, or no positive one where it must be.
    """

    joints: ClassVar[int] = 6
    groups: ClassVar[tuple[str, ...]] = ("published", "assumed")

    neck_length: float
    shoulder_offset: float
    upper_arm_length: float
    forearm_length: float
    hand_length: float
    position_limits: tuple[float, ...]
    elbow_limit: float
    shoulder_limit: float
    initial_posture: tuple[float, ...]
    body_height: float
    shoulder_radius: float
    joint_rates: tuple[float, ...]
    acceleration_time: float
    neck_radius: float
    upper_arm_radius: float
    forearm_radius: float
    hand_radius: float
    body_half_thickness: float
    clearance: float

    @functools.cached_property
    def joint_accelerations(self) -> tuple[float, ...]:
        """Largest accelerations: rate / ``acceleration_time`` [rad/s^2]."""
        return tuple(rate / self.acceleration_time for rate in self.joint_rates)


@dataclass(frozen=True)
class TwoEndedData(_Numbers):
    """Numbers of the two-ended arm in SI: offsets and lengths [m], limit and posture [rad], rate [rad/s], radii [m].

    Raises:
        ShapeError, NotFiniteError, RangeError: a field that is no number, or no positive one where it must be.
    """

    joints: ClassVar[int] = 7
    groups: ClassVar[tuple[str, ...]] = ("two_ended", "two_ended_assumed")

    roll_offset: float
    yaw_offset: float
    pitch_offset: float
    boom_length: float
    elbow_offset: float
    position_limit: float
    initial_posture: tuple[float, ...]
    joint_rate: float
    boom_radius: float
    wrist_radius: float
    acceleration_time: float


def _exact(value: Any) -> str:
    return " ".join(float(x).hex() for x in (value if isinstance(value, tuple) else (value,)))


@functools.cache
def _read(path: pathlib.Path) -> dict[str, dict[str, Any]]:
    """Group -> field -> value in SI."""
    try:
        groups = tomllib.loads(path.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
        raise RobotFileError("data", str(path), f"cannot be read: {error}") from error
    out: dict[str, dict[str, Any]] = {}
    for group in (*WalkerData.groups, *TwoEndedData.groups):
        rows = groups.get(group)
        if not isinstance(rows, dict):
            raise RobotFileError("data", str(path), f"the group [{group}] must be there")
        out[group] = dict(_si(f"{path.name} [{group}] {key}", key, value) for key, value in rows.items())
    return out


def _si(label: str, key: str, value: Any) -> tuple[str, Any]:
    """Name without its unit, value in SI."""
    suffix = next((s for s in _UNITS if key.endswith(s)), None)
    if suffix is None:
        raise RobotFileError("data", label, f"the name must end with its unit: {', '.join(_UNITS)}")
    numbers = validation.real_array(label, value)
    if numbers.ndim > 1:
        raise ShapeError(label, value, "expected a number or a list of numbers")
    scaled = (numbers * _UNITS[suffix]).tolist()
    return key.removesuffix(suffix), tuple(scaled) if isinstance(scaled, list) else scaled
