"""The published files: robot data, trajectories, angles, spheres, one Jacobian. One record a line, blanks between.

Angles in files are degrees, lengths metres, also of sliding joints; the report prints no layout beyond the order.
"""

from __future__ import annotations

import math
import pathlib
import re
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from wbc import robots, validation
from wbc.errors import WbcError
from wbc.published.ikor.lines import Trajectory
from wbc.published.ikor.machines import ArmMachine, airarm, hermies, machine_of, planar
from wbc.published.ikor.polygons import convex_parts
from wbc.validation import Array

#: Points of a trajectory beyond these are dropped, as published, where no other number is asked for
MAX_POINTS = 1000
#: What numbers and counts look like: no other digits or separators, which Python would take
NUMBER = re.compile(r"[-+]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][-+]?[0-9]+)?")
WHOLE = re.compile(r"-?[0-9]{1,6}")


class IkorFileError(WbcError):
    """A file that is not what it should be; ``field`` names the file and the line, ``value`` what stands there."""


class _FileLines:
    """Lines with something on them, with their numbers."""

    def __init__(self, file: Any) -> None:
        self.path = validation.file_path("file", file)
        text = validation.text_of(str(self.path), self.path, IkorFileError)
        self.left = [(k, line.split("#")[0].split()) for k, line in enumerate(text.splitlines(), 1)]
        self.left = [(k, words) for k, words in self.left if words]
        self.last = self.left[-1][0] if self.left else 0

    def words(self, count: int, what: str) -> tuple[int, list[str]]:
        if not self.left:
            raise IkorFileError(f"{self.path.name}:{self.last + 1}", "", f"the file ends where {what} should be")
        number, words = self.left.pop(0)
        if len(words) != count:
            raise self.error(number, " ".join(words), f"expected {what}: {count} entries, not {len(words)}")
        return number, words

    def numbers(self, count: int, what: str) -> Array:
        """The next line, of so many numbers."""
        number, words = self.words(count, what)
        return np.array([self.number(number, word, what) for word in words])

    def number(self, line: int, word: str, what: str) -> float:
        """A finite number of reasonable size."""
        try:
            return validation.scalar(what, float(word) if NUMBER.fullmatch(word) else math.nan)
        except WbcError:
            raise self.error(line, word, f"expected {what}: a finite number") from None

    def counts(self, count: int, what: str, low: int = 0) -> list[int]:
        """The next line, whole numbers of six digits at most."""
        line, words = self.words(count, what)
        for word in words:
            if not WHOLE.fullmatch(word) or int(word) < low:
                raise self.error(line, word, f"expected {what}: a whole number from {low}")
        return [int(word) for word in words]

    def end(self) -> None:
        """Nothing may follow."""
        if self.left:
            raise self.error(self.left[0][0], " ".join(self.left[0][1]), "nothing more was expected")

    def error(self, line: int, value: str, reason: str) -> IkorFileError:
        return IkorFileError(f"{self.path.name}:{line}", value, reason)


def read_trajectory(file: Any, machine: ArmMachine, angles: Any = None, most: int = MAX_POINTS) -> Trajectory:
    """``TrajectoryPts``: initial joints, number of points, a point a line; ``EulerAngles``: yaw, pitch, roll a line.
    Points beyond ``most`` are left out, and counted.

    Raises:
        IkorFileError: a bad line, by number and value.
    """
    lines = _FileLines(file)
    start = lines.numbers(machine.joints, "initial joints") / _units(machine)
    (count,) = lines.counts(1, "the number of points", -999_999)
    points = np.array([lines.numbers(3, f"point {k + 1}") for k in range(max(0, count))]).reshape(-1, 3)
    lines.end()
    euler = None
    if angles is not None:
        lines = _FileLines(angles)
        euler = np.radians([lines.numbers(3, f"yaw, pitch, roll {k + 1}") for k in range(len(points))]).reshape(-1, 3)
        lines.end()
        euler = euler[:most]
    return Trajectory(start, points[:most], euler, max(0, len(points) - most))


def write_trajectory(file: Any, machine: ArmMachine, trajectory: Trajectory, angles: Any = None) -> None:
    """The same back, to 9 digits."""
    rows = [trajectory.start * _units(machine), [len(trajectory.points)], *trajectory.points]
    _write(file, rows)
    if angles is not None:
        euler = np.zeros_like(trajectory.points) if trajectory.euler is None else trajectory.euler
        _write(angles, np.degrees(euler))


def read_spheres(file: Any) -> Array:
    """``sphere_data``: x, y, z, radius a line, any number of them; radius 0 for none [count, 4].

    Raises:
        IkorFileError: a bad line.
    """
    lines, out = _FileLines(file), list[Array]()
    while lines.left:
        line = lines.left[0][0]
        sphere = lines.numbers(4, "a sphere: x, y, z, radius")
        if sphere[3] < 0.0:
            raise lines.error(line, f"{sphere[3]:g}", "expected a radius >= 0")
        if sphere[3] > 0.0:
            out.append(sphere)
    return np.array(out).reshape(-1, 4)


def write_spheres(file: Any, spheres: Array) -> None:
    """The same back."""
    _write(file, spheres)


def read_polygons(file: Any) -> list[Array]:
    """``polygon_data``: x and y of the corners of a polygon a line, three or more, in order [k, 2] each.

    Raises:
        IkorFileError: a bad line.
    """
    lines, out = _FileLines(file), list[Array]()
    while lines.left:
        line, words = lines.left[0]
        what = "a polygon: x, y of three corners or more"
        if len(words) < 6 or len(words) % 2:
            raise lines.error(line, " ".join(words), f"expected {what}")
        out.append(lines.numbers(len(words), what).reshape(-1, 2))
        try:
            convex_parts(out[-1])
        except WbcError as error:
            raise lines.error(line, " ".join(words), str(error)) from None
    return out


def write_polygons(file: Any, polygons: Sequence[Array]) -> None:
    """The same back."""
    _write(file, [corners.ravel() for corners in polygons])


def read_angles(file: Any, machine: ArmMachine) -> Array:
    """``CheezyAngles``: the columns of every step [steps, M].

    Raises:
        IkorFileError: a bad line.
    """
    lines, out = _FileLines(file), list[Array]()
    while lines.left:
        out.append(lines.numbers(machine.joints, f"joints of step {len(out) + 1}"))
    return np.array(out).reshape(-1, machine.joints) / _units(machine)


def write_angles(file: Any, machine: ArmMachine, q: Array) -> None:
    """The same back."""
    _write(file, q * _units(machine))


def read_jacobian(file: Any) -> tuple[Array, Array]:
    """``FSP_data``: N and M, N rows of J, then N rates: for the generator on one Jacobian.

    Raises:
        IkorFileError: a bad line.
    """
    lines = _FileLines(file)
    n, m = lines.counts(2, "rows and joints", 1)
    J = np.array([lines.numbers(m, f"row {k + 1} of J") for k in range(n)])
    x = np.array([lines.numbers(1, f"rate {k + 1}")[0] for k in range(n)])
    lines.end()
    return J, x


def named(robot: str, base: str = "none") -> ArmMachine:
    """hermies, airarm or planar, or the machine of a file, on a platform.

    Raises:
        IkorFileError: no such file, or a bad line. UnknownNameError: no such platform.
    """
    makers: dict[str, Callable[[str], ArmMachine]] = {
        "hermies": hermies,
        "airarm": airarm,
        "planar": lambda _: planar(),
    }
    return makers[robot](base) if robot in makers else read_robot(robot, base)


def read_robot(file: Any, base: str = "none") -> ArmMachine:
    """``ROBOT.dat``: number of links, lengths; number of joints, a row each: most, least, prismatic, weight, home;
    platform, its plate, its offsets (Z, L, angle); and what knows the kinematics: HERMIES, AIRARM, PLANAR (with
    ``Jacob_`` and an ending, if you like) or a URDF file beside it. ``base``: of :data:`BASES`, where a platform is.

    Raises:
        IkorFileError: a bad line.
    """
    lines = _FileLines(file)
    (count,) = lines.counts(1, "the number of links", 1)
    links = lines.numbers(count, "lengths of links")
    (joints,) = lines.counts(1, "the number of joints", 1)
    rows, flags = [], []
    for k in range(joints):
        what = f"joint {k + 1}: most, least, prismatic, weight, home"
        line, words = lines.words(5, what)
        flags.append(_flag(lines, line, words[2]))
        most, least, weight, home = (lines.number(line, words[i], what) for i in (0, 1, 3, 4))
        if least > most or not least <= home <= most or not 0.0 < weight <= 1.0:
            raise lines.error(line, " ".join(words), f"expected {what}, least <= home <= most and 0 < weight <= 1")
        rows.append((most, least, weight, home))
    line, (platform,) = lines.words(1, "platform Y or N")
    on = _flag(lines, line, platform)
    lines.numbers(3, "length, width and thickness of the plate")
    height, along, turn = lines.numbers(3, "offsets: Z, L, angle")
    line, (reference,) = lines.words(1, "the kinematics")
    lines.end()
    a = np.radians(turn)
    offset = (-along * np.cos(a), -along * np.sin(a), height)
    name = reference.removeprefix("Jacob_").split(".")[0].upper()
    makers: dict[str, Callable[..., ArmMachine]] = {"HERMIES": hermies, "AIRARM": airarm}
    try:
        if name in makers:
            machine = makers[name](base if on else "none", links, offset)
        elif name == "PLANAR":
            machine = planar(links.tolist())
        elif reference.lower().endswith(".urdf"):
            robot = robots.load(lines.path.parent / reference, shapes="none")
            machine = machine_of(robot, str(robot.frame_names[-1]))
        else:
            choices = (*makers, "PLANAR", "a URDF file")
            raise lines.error(line, reference, f"expected one of {', '.join(choices)}")
    except WbcError as error:
        if isinstance(error, IkorFileError):
            raise
        raise lines.error(line, reference, str(error)) from error
    return _with_rows(machine, np.array(rows), flags, lines, line)


def _with_rows(machine: ArmMachine, rows: Array, flags: list[bool], lines: _FileLines, line: int) -> ArmMachine:
    """The machine with a file's limits, weights and home; rows of a platform may be there and not be used."""
    count, units = machine.joints, _units(machine)
    if len(rows) < count and machine.base != "none":
        # A platform whose rows are left out keeps its own
        own = np.column_stack((machine.upper * units, machine.lower * units, machine.weights, machine.home * units))
        rows, flags = np.vstack((rows, own[len(rows) :])), [*flags, *machine.prismatic[len(flags) :]]
    if len(rows) < count:
        raise lines.error(line, str(len(rows)), f"expected {count} joints for these kinematics")
    if tuple(flags[:count]) != machine.prismatic:
        wrong = next(k for k in range(count) if flags[k] != machine.prismatic[k])
        raise lines.error(line, f"joint {wrong + 1}", "prismatic in the file or in the kinematics, not in both")
    most, least, weights, home = rows[:count].T
    return replace(machine, upper=most / units, lower=least / units, weights=weights, home=home / units)


def _flag(lines: _FileLines, line: int, word: str) -> bool:
    if word.upper() not in ("Y", "N"):
        raise lines.error(line, word, "expected Y or N")
    return word.upper() == "Y"


def _units(machine: ArmMachine) -> Array:
    """What columns are multiplied by in files."""
    return np.where(machine.prismatic, 1.0, np.degrees(1.0))


def _write(file: Any, rows: Iterable[Any]) -> None:
    text = "\n".join(" ".join(f"{x:.12g}" for x in np.atleast_1d(row)) for row in rows)
    pathlib.Path(file).write_text(text + "\n")
