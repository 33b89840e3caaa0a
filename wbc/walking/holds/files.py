"""Structures as files: comma-separated rows in three sections.

    id, x, y, z, ax, ay, az, rx, ry, rz, roll, max_tilt, on
    h1, 0, 0, 0, 0, 0, -1, 1, 0, 0, free, 0.05, surface

    [obstacles]
    id, shape, x, y, z, ax, ay, az, rx, ry, rz, d1, d2, d3
    tank, box, 1, 0, 0.2, 0, 0, 1, 1, 0, 0, 0.3, 0.3, 0.4
    pipe, capsule, 2, 0, 0.1, 1, 0, 0, 0, 0, 1, 0.05, 1.5,

    [surface]
    shape, x, y, z, ax, ay, az, rx, ry, rz, d1
    plane, 0, 0, 0, 0, 0, 1, 1, 0, 0,

(x, y, z) is the origin [m], (ax, ay, az) the z axis and (rx, ry, rz) the direction whose part across it is the x axis,
of any length. Holds come first, with z the approach direction, roll ``free``, ``fixed`` or a whole number from 2 to
360, max_tilt [rad], and what the hold is mounted on: the id of an obstacle, ``surface``, or nothing where nobody says;
the column ``on`` may be left out. The numbers d1, d2, d3 of a box are its sides along x, y, z; of a capsule radius and
length between the centres of its ends, along z; of a sphere its radius; of a cylinder, which has flat ends, radius and
length along z. Of a mesh d1 is an STL file, by its path from the structure's file, whose surface is closed, and d2 what
its lengths are multiplied by (1 if empty). Of a ``cylinder`` surface d1 is the radius about z, and a ``plane`` has
none. A text with a comma in it stands in double quotes. Empty lines and lines that begin with ``#`` do not count.
"""

from __future__ import annotations

import csv
import os
import pathlib
import re
from collections.abc import Mapping, Sequence
from math import isfinite
from typing import Any, TextIO

import numpy as np

from wbc import validation
from wbc.clearance import TriangleMesh
from wbc.errors import StructureFileError, WbcError
from wbc.multibody import pin
from wbc.shapes import Box, Capsule, Cylinder, Sphere
from wbc.validation import Array
from wbc.walking.holds.hold import SURFACE, Hold, checked_id, checked_roll, frame_of
from wbc.walking.holds.obstacle import Obstacle, ObstacleShape
from wbc.walking.holds.structure import Structure
from wbc.walking.holds.surface import CylinderSurface, PlaneSurface, Surface

_POSE = ("x", "y", "z", "ax", "ay", "az", "rx", "ry", "rz")
#: Section -> its columns; the first has no line of its own
COLUMNS: Mapping[str, tuple[str, ...]] = {
    "holds": ("id", *_POSE, "roll", "max_tilt", "on"),
    "obstacles": ("id", "shape", *_POSE, "d1", "d2", "d3"),
    "surface": ("shape", *_POSE, "d1"),
}
#: Section -> how many of its last columns may be left out
OPTIONAL: Mapping[str, int] = {"holds": 1, "obstacles": 0, "surface": 0}
#: Shape -> how many of d1, d2, d3 it has; a mesh has a file
_OBSTACLES = {"box": 3, "capsule": 2, "sphere": 1, "cylinder": 2}
_SURFACES = {"plane": 0, "cylinder": 1}
#: What a mesh's file name does not take over from the structure's
_UNPLAIN = re.compile(r"[^\w.-]")


def read_structure(path: str | os.PathLike[str]) -> Structure:
    """The structure of a file; its name is the file's stem.

    Raises:
        StructureFileError: a file that cannot be read, or a bad line: ``field`` names the line and the column.
    """
    file = validation.file_path("path", path)
    try:
        text = file.read_text(encoding="utf-8-sig")
    except (OSError, UnicodeDecodeError) as error:
        raise StructureFileError("structure", str(path), f"cannot be read: {error}") from error
    return parse_structure(text, file.stem, file.parent)


def parse_structure(text: str, name: str = "structure", folder: str | os.PathLike[str] = ".") -> Structure:
    """The structure in a text; see the module for its form. The paths of meshes count from ``folder``.

    Raises:
        StructureFileError: a bad line: ``field`` names the line and the column.
    """
    validation.instance("text", text, str, "text")
    beside = validation.file_path("folder", folder)
    section = "holds"
    header: Sequence[str] = ()
    holds: dict[str, Hold] = {}
    obstacles: dict[str, Obstacle] = {}
    lines = dict[str, _Row]()
    surface: Surface | None = None
    for number, line in enumerate(text.splitlines(), start=1):
        if not line.strip() or line.lstrip().startswith("#"):
            continue
        if line.lstrip().startswith("["):
            section, header = _section(number, line), ()
            continue
        cells = _cells(number, line)
        if not header:
            header = _header(number, cells, section)
            continue
        row = _row(number, cells, header)
        if section == "holds":
            _add(number, holds, _hold(row))
            lines[row.cells["id"]] = row
        elif section == "obstacles":
            _add(number, obstacles, _obstacle(row, beside))
        elif surface is not None:
            raise StructureFileError(f"line {number}", line.strip(), "a structure has one surface")
        else:
            surface = _surface(row)
    if not holds:
        raise StructureFileError("holds", name, "the file has no hold")
    there = [*([] if surface is None else [SURFACE]), *obstacles]
    for hold in holds.values():
        if hold.on and hold.on not in there:
            reason = "neither an obstacle nor the surface of this file"
            raise StructureFileError(lines[hold.id].field("on"), hold.on, reason, there)
    return Structure(name, tuple(holds.values()), tuple(obstacles.values()), surface)


def save_structure(structure: Structure, path: str | os.PathLike[str]) -> pathlib.Path:
    """Writes a structure such that reading gives every number back within 1e-15 of its size; returns the file.

    A mesh becomes an STL file beside it, NAME-K.stl for the K-th obstacle, whose corners have single precision.

    Raises:
        StructureFileError: the file cannot be written.
    """
    validation.instance("structure", structure, Structure, "a Structure")
    file = validation.file_path("path", path)
    mounted = any(hold.on for hold in structure.holds)
    # Written beside its place and renamed into it, so that no reader ever meets half a file
    fresh = file.with_name(f".{file.name}")
    try:
        with fresh.open("w", encoding="utf-8", newline="") as stream:
            out = _Writer(stream)
            out.writerow(COLUMNS["holds"] if mounted else COLUMNS["holds"][:-1])
            for hold in structure.holds:
                on = [_quoted(hold.on)] if mounted else []
                out.writerow([hold.id, *_numbers(hold.pose), hold.roll, repr(hold.max_tilt), *on])
            if structure.obstacles:
                stream.write("\n[obstacles]\n")
                out.writerow(COLUMNS["obstacles"])
            for k, obstacle in enumerate(structure.obstacles, start=1):
                if isinstance(obstacle.shape, TriangleMesh):
                    mesh = file.with_name(f"{_UNPLAIN.sub('_', file.stem)}-{k}.stl")
                    _write_stl(mesh, obstacle.shape.corners)
                    kind, sizes = "mesh", [mesh.name, "", ""]
                else:
                    kind, sizes = _shape_numbers(obstacle.shape)
                out.writerow([obstacle.id, kind, *_numbers(obstacle.placement), *sizes])
            if structure.surface is not None:
                stream.write("\n[surface]\n")
                out.writerow(COLUMNS["surface"])
                round_ = isinstance(structure.surface, CylinderSurface)
                size = repr(structure.surface.radius) if isinstance(structure.surface, CylinderSurface) else ""
                out.writerow(["cylinder" if round_ else "plane", *_numbers(structure.surface.pose), size])
        fresh.replace(file)
    except OSError as error:
        raise StructureFileError("path", str(path), f"cannot be written: {error.strerror}") from error
    return file


class _Writer:
    """Rows of cells; names are quoted where they would be read as something else."""

    def __init__(self, stream: TextIO) -> None:
        self.stream = stream

    def writerow(self, cells: Sequence[Any]) -> None:
        first, *rest = (str(cell) for cell in cells)
        self.stream.write(",".join([_quoted(first), *rest]) + "\n")


def _quoted(text: str) -> str:
    """A cell of a name."""
    if text[:1] in ("#", "[") or any(sign in text for sign in ',"'):
        return '"' + text.replace('"', '""') + '"'
    return text


class _Row:
    """One line: its cells by column, read with errors that name both."""

    def __init__(self, number: int, cells: Mapping[str, str]) -> None:
        self.number, self.cells = number, cells

    def field(self, column: str) -> str:
        return f"line {self.number}: {column}"

    def text(self, column: str) -> str:
        if not self.cells[column]:
            raise StructureFileError(self.field(column), "", "expected a text")
        return self.cells[column]

    def name(self) -> str:
        text = self.text("id")
        return str(self.made("id", lambda: checked_id("id", text)))

    def real(self, column: str, low: float | None = None) -> float:
        value = self.cells[column]
        try:
            number = float(value)
        except ValueError as error:
            raise StructureFileError(self.field(column), value, "expected a number") from error
        if not isfinite(number):
            raise StructureFileError(self.field(column), value, "expected a finite number")
        if low is not None and number < low:
            raise StructureFileError(self.field(column), value, f"expected a number of at least {low:g}")
        return number

    def choice(self, column: str, choices: Sequence[str]) -> str:
        if self.cells[column] not in choices:
            raise StructureFileError(self.field(column), self.cells[column], "unknown", choices)
        return self.cells[column]

    def pose(self) -> pin.SE3:
        position, axis, reference = ([self.real(c) for c in _POSE[k : k + 3]] for k in (0, 3, 6))
        for columns, vector in (("ax, ay, az", axis), ("rx, ry, rz", reference)):
            if not any(vector):
                raise StructureFileError(
                    self.field(columns), vector, "expected a direction: a vector of non-zero length"
                )
        return self.made("rx, ry, rz", lambda: frame_of("frame", position, axis, reference))

    def sizes(self, kind: str, count: int) -> list[float]:
        columns = [c for c in ("d1", "d2", "d3") if c in self.cells]
        for column in columns[count:]:
            if self.cells[column]:
                raise StructureFileError(self.field(column), self.cells[column], f"a {kind} has {count} sizes")
        return [self.real(column, low=0.0) for column in columns[:count]]

    def made(self, column: str, make: Any) -> Any:
        """What ``make`` returns; its typed error becomes one about this line and column."""
        try:
            return make()
        except StructureFileError:
            raise
        except WbcError as error:
            reason = str(error).removeprefix(f"{error.field}: ").split(" (got ")[0]
            raise StructureFileError(self.field(column), error.value, reason) from error


def _hold(row: _Row) -> Hold:
    name, pose, tilt = row.name(), row.pose(), row.real("max_tilt", low=0.0)
    text = row.text("roll")
    whole = text.isdecimal() and len(text) < 9
    roll = row.made("roll", lambda: checked_roll("roll", int(text) if whole else text))
    on = row.cells.get("on", "")
    row.made("on", lambda: on and checked_id("on", on))
    found: Hold = row.made("max_tilt", lambda: Hold(name, pose, roll, tilt, on))
    return found


def _obstacle(row: _Row, folder: pathlib.Path) -> Obstacle:
    name, kind, pose = row.name(), row.choice("shape", (*_OBSTACLES, "mesh")), row.pose()
    if kind == "mesh":
        return Obstacle(name, _mesh(row, folder), pose)
    sizes: Any = row.sizes(kind, _OBSTACLES[kind])
    makes = {"box": lambda: Box(tuple(sizes)), "capsule": lambda: Capsule(*sizes)}
    makes |= {"sphere": lambda: Sphere(*sizes), "cylinder": lambda: Cylinder(*sizes)}
    shape: ObstacleShape = row.made("d1, d2, d3", makes[kind])
    return Obstacle(name, shape, pose)


def _mesh(row: _Row, folder: pathlib.Path) -> TriangleMesh:
    path = row.text("d1")
    if row.cells["d3"]:
        raise StructureFileError(row.field("d3"), row.cells["d3"], "a mesh has a file and a scale")
    scale = row.real("d2", low=0.0) if row.cells["d2"] else 1.0
    if "\0" in path or pathlib.Path(path).suffix.lower() != ".stl":
        raise StructureFileError(row.field("d1"), path, "expected an STL file")
    if not validation.is_file("d1", folder / path):
        raise StructureFileError(row.field("d1"), path, "there is no such file")
    if scale == 0.0:
        raise StructureFileError(row.field("d2"), row.cells["d2"], "expected a scale above 0")
    try:
        return TriangleMesh.read(folder / path, scale)
    except WbcError as error:
        reason = str(error).removeprefix(f"{error.field}: ").split(" (got ")[0]
        raise StructureFileError(row.field("d1"), path, reason) from error


def _write_stl(path: pathlib.Path, corners: Array) -> None:
    """A binary STL file: 80 bytes, the count, and a triangle's normal, corners and two more bytes."""
    out = np.zeros(len(corners), dtype=[("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("more", "<u2")])
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    length = np.linalg.norm(normal, axis=1, keepdims=True)
    out["normal"], out["corners"] = normal / np.where(length > 0.0, length, 1.0), corners
    path.write_bytes(bytes(80) + np.uint32(len(corners)).astype("<u4").tobytes() + out.tobytes())


def _surface(row: _Row) -> Surface:
    kind, pose = row.choice("shape", tuple(_SURFACES)), row.pose()
    sizes = row.sizes(kind, _SURFACES[kind])
    if kind == "plane":
        return PlaneSurface(pose)
    found: CylinderSurface = row.made("d1", lambda: CylinderSurface(pose, sizes[0]))
    return found


def _section(number: int, line: str) -> str:
    name = line.split("#")[0].strip().strip(",").strip()
    if name not in ("[obstacles]", "[surface]"):
        raise StructureFileError(f"line {number}", name, "no such section", ("[obstacles]", "[surface]"))
    return name.strip("[]")


def _cells(number: int, line: str) -> list[str]:
    try:
        return [cell.strip() for cell in next(csv.reader([line], skipinitialspace=True, strict=True))]
    except csv.Error as error:
        raise StructureFileError(f"line {number}", line.strip(), f"cannot be read: {error}") from error


def _header(number: int, cells: Sequence[str], section: str) -> Sequence[str]:
    """The columns of a section, with those that it may leave out or without."""
    columns = COLUMNS[section]
    if tuple(cells) not in (columns, columns[: len(columns) - OPTIONAL[section]]):
        raise StructureFileError(f"line {number}", ", ".join(cells), f"expected the columns {', '.join(columns)}")
    return cells


def _row(number: int, cells: Sequence[str], columns: Sequence[str]) -> _Row:
    if len(cells) != len(columns):
        reason = f"expected {len(columns)} values, not {len(cells)}: {', '.join(columns)}"
        raise StructureFileError(f"line {number}", ", ".join(cells), reason)
    return _Row(number, dict(zip(columns, cells, strict=True)))


def _add(number: int, known: dict[str, Any], thing: Hold | Obstacle) -> None:
    if thing.id in known:
        raise StructureFileError(f"line {number}: id", thing.id, "two of this id")
    known[thing.id] = thing


def _numbers(pose: pin.SE3) -> list[str]:
    vectors = (pose.translation, pose.rotation[:, 2], pose.rotation[:, 0])
    return [repr(float(x)) for vector in vectors for x in vector]


def _shape_numbers(shape: Box | Capsule | Sphere | Cylinder) -> tuple[str, list[str]]:
    if isinstance(shape, Box):
        return "box", [repr(x) for x in shape.size]
    if isinstance(shape, Sphere):
        return "sphere", [repr(shape.radius), "", ""]
    return type(shape).__name__.lower(), [repr(shape.radius), repr(shape.length), ""]
