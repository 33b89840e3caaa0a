"""How a robot is made out of a description: what the table, or the caller, adds to the file."""

from __future__ import annotations

import fnmatch
from collections.abc import Mapping, Sequence
from dataclasses import field
from typing import Any

import numpy as np

from wbc import validation
from wbc.errors import ShapeError, UnknownNameError
from wbc.multibody import own
from wbc.quick_dataclasses import dataclass
from wbc.robot.loops import AnyLoop
from wbc.shapes import Capsule, PlacedShape, Sphere
from wbc.validation import Array


@dataclass(frozen=True)
class LinkShape:
    """A sphere or capsule on a link: the core segment from ``a`` to ``b`` [m], ``radius`` and ``excess`` [m]."""

    link: str
    a: tuple[float, float, float]
    b: tuple[float, float, float]
    radius: float
    excess: float = 0.0

    def placed(self) -> PlacedShape:
        """The shape in the link's frame."""
        return segment_shape(np.array(self.a), np.array(self.b), self.radius, self.excess)


@dataclass(frozen=True)
class Recipe:
    """A row of the table of robots.

    Attributes:
        name: as ``wbc.robots.load`` takes it.
        about: one line.
        file: relative to the folder ``robots`` of the example-robot-data wheel.
        base: one of :data:`~wbc.robot.robot.BASES`.
        lock: joint name or pattern (``finger_*``) -> value of q to lock it at, or None for the neutral one.
        srdf: file of collision rules, rotors and named configurations, "" for none.
        state: its configuration that is the neutral one, "" for none.
        neutral: joint name -> number, on top of that.
        frames: role -> frame name.
        acceleration: joint name -> limit [rad/s^2 or m/s^2].
        source: where the acceleration limits were published; "" where none are known.
        mimic_leaders: follower -> leader, where the file misspells the leader.
        shapes: spheres and capsules fitted in advance.
        pairs: file of the pairs of links that must not touch, found with these shapes and locks; "" for none.
        problem: why the file cannot be loaded; "" for robots that can.
        actuated: joints with motors, see :meth:`~wbc.robot.Robot.with_actuated`; ``"transmissions"``: those that the
            file has a ``<transmission>`` of; None: as an MJCF file says, else all.
        loops: whether closed loops of the description are kept, see :meth:`~wbc.robot.Robot.with_loops`.
        more_loops: than the description has.
        arguments: of a xacro file, name -> value.
    """

    name: str
    about: str = ""
    file: str = ""
    base: str = "fixed"
    lock: Mapping[str, float | None] = field(default_factory=dict)
    srdf: str = ""
    state: str = ""
    neutral: Mapping[str, float] = field(default_factory=dict)
    frames: Mapping[str, str] = field(default_factory=dict)
    acceleration: Mapping[str, float] = field(default_factory=dict)
    source: str = ""
    mimic_leaders: Mapping[str, str] = field(default_factory=dict)
    shapes: tuple[LinkShape, ...] = ()
    pairs: str = ""
    problem: str = ""
    actuated: Sequence[str] | None = None
    loops: bool = True
    more_loops: tuple[AnyLoop, ...] = ()
    arguments: Mapping[str, str] = field(default_factory=dict)


def lock_mapping(lock: Any) -> dict[str, float | None]:
    """Joint name or pattern -> value or None, out of a name, a sequence of names or a mapping.

    Raises:
        ShapeError: something else.
        NotFiniteError: a value that is no finite number.
    """
    if isinstance(lock, str):
        return {lock: None}
    if isinstance(lock, Mapping):
        out: dict[str, float | None] = {}
        for key, value in lock.items():
            out[str(key)] = None if value is None else validation.scalar(f"lock[{key!r}]", value)
        return out
    if isinstance(lock, Sequence) and all(isinstance(name, str) for name in lock):
        return dict.fromkeys(lock, None)
    raise ShapeError("lock", lock, "expected joint names, or a mapping from joint name to value")


def expand(field_name: str, patterns: Mapping[str, float | None], names: Sequence[str]) -> dict[str, float | None]:
    """Patterns replaced by the names that they match; each must match at least one.

    Raises:
        UnknownNameError: a name or pattern without a match.
    """
    out: dict[str, float | None] = {}
    for pattern, value in patterns.items():
        matches = [pattern] if pattern in names else fnmatch.filter(names, pattern)
        if not matches:
            raise UnknownNameError(field_name, pattern, names)
        out |= dict.fromkeys(matches, value)
    return out


def segment_shape(a: Array, b: Array, radius: float, excess: float) -> PlacedShape:
    """A capsule about the segment a b, or a sphere where a = b, with its z axis along b - a."""
    span = b - a
    length = float(np.linalg.norm(span))
    if length == 0.0:
        return PlacedShape(Sphere(radius), own.SE3(np.eye(3), np.array(a, dtype=float)), excess)
    turn = own.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), span / length).matrix()
    return PlacedShape(Capsule(radius, length), own.SE3(turn, (a + b) / 2), excess)
