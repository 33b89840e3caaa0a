"""Scenes as files: comma-separated rows in sections.

    id, x, y, z, ax, ay, az, rx, ry, rz, roll, on, friction, limbs
    h1, 0, 0, 0, 0, 0, -1, 1, 0, 0, free, floor, 0.7, left; right

    [obstacles]
    id, shape, x, y, z, ax, ay, az, rx, ry, rz, d1, d2, d3
    floor, half_space, 0, 0, 0, 0, 0, 1, 1, 0, 0,,,
    tank, box, 1, 0, 0.2, 0, 0, 1, 1, 0, 0, 0.3, 0.3, 0.4
    pipe, capsule, 2, 0, 0.1, 1, 0, 0, 0, 0, 1, 0.05, 1.5,

    [gravity]
    x, y, z
    0, 0, -9.81

(x, y, z) is the origin [m], (ax, ay, az) the z axis and (rx, ry, rz) the direction whose part across it is the x axis,
of any length.

Footholds come first. Their z axis is the way to them, against the outward normal. roll is ``free``, ``fixed`` (x of
the limb along x) or a whole number from 2 to 360 (fixed, or turned by a multiple of 2 pi / n); limbs that are free to
turn about z are not bound by it. Other columns may be left out, and their cells be empty. on: id of the body that a
limb at it may touch; ``none``: none; empty: the nearest body within 1 cm. friction: Coulomb's coefficient; empty: the
limb's own. limbs: those that may hold it, with semicolons; empty: all. max_tilt: how far a limb that holds may lean
[rad]; limbs hold without leaning, so a file that allows it is read with a warning.

d1, d2, d3 of a body: box: sides along x, y, z; sphere: radius; capsule and cylinder (flat ends): radius and length
along z, a capsule's between the centres of its ends; ellipsoid: semi-axes; half_space (z <= 0): none; endless_cylinder
and cylinder_inside (the wall round it), about z: radius; mesh (a closed surface), sheet (an open one) and convex (the
hull of its corners): a file STL, OBJ, DAE or NPY (triangles [n, 3, 3], of a hull points [n, 3] in double precision), by
its path from this file, and what its lengths are multiplied by (empty: 1).

A section ``[surface]`` with the columns shape, x, ..., rz, d1 and one row, ``plane`` or ``cylinder`` (without end), is
the body ``surface``. A text with a comma in it stands in double quotes. Empty lines and lines that begin with ``#`` do
not count.
"""

from __future__ import annotations

import csv
import io
import os
import pathlib
import re
import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import fields, replace
from math import inf, isfinite, pi
from typing import Any

import numpy as np

from wbc import validation
from wbc.clearance import CylinderInside, EndlessCylinder, TriangleMesh
from wbc.clearance.scene import Shape
from wbc.climb.scene import ClimbScene, Foothold, SceneBody, frame_along
from wbc.errors import StructureFileError, WbcError
from wbc.multibody import pin
from wbc.shapes import Box, Capsule, Convex, Cylinder, Ellipsoid, HalfSpace, Sphere
from wbc.validation import Array

_POSE = ("x", "y", "z", "ax", "ay", "az", "rx", "ry", "rz")
_SIZES = ("d1", "d2", "d3")
#: Section -> (columns that it has, columns that it may have); the first has no line of its own
COLUMNS: Mapping[str, tuple[tuple[str, ...], tuple[str, ...]]] = {
    "footholds": (("id", *_POSE, "roll"), ("max_tilt", "on", "friction", "limbs")),
    "obstacles": (("id", "shape", *_POSE, *_SIZES), ()),
    "surface": (("shape", *_POSE, "d1"), ()),
    "gravity": (("x", "y", "z"), ()),
}
#: Shape -> its class and how many of d1, d2, d3 it has
_SOLIDS: Mapping[str, tuple[Callable[..., Shape], int]] = {
    "box": (Box, 3),
    "capsule": (Capsule, 2),
    "sphere": (Sphere, 1),
    "cylinder": (Cylinder, 2),
    "ellipsoid": (Ellipsoid, 3),
    "half_space": (HalfSpace, 0),
    "endless_cylinder": (EndlessCylinder, 1),
    "cylinder_inside": (CylinderInside, 1),
}
#: Shapes that have a file
_OF_FILES = ("mesh", "sheet", "convex")
#: Endings of such files
_ENDINGS = (".stl", ".obj", ".dae", ".npy")
#: What the surface of the section ``surface`` is
_SURFACES = {"plane": "half_space", "cylinder": "endless_cylinder"}
#: Id of the body of that section
SURFACE = "surface"
#: In the column ``on``: no body
NO_BODY = "none"
#: A foothold of a file that does not say what it is on is on a body as near as this [m]: less than a hand is wide
MOUNTED = 0.01
#: Most positions of a limb about a foothold's axis
MOST_ROLLS = 360
#: Largest error of squares and products of axes that are orthonormal to the last digits [1]
ORTHONORMAL = 16 * float(np.finfo(float).eps)
#: What a shape's file name does not take over from the scene's
_UNPLAIN = re.compile(r"[^\w.-]")
#: Signs of a body's frame that becomes a foothold's, whose z axis is the other way
_TURNED = np.array([1.0, -1.0, -1.0])


def read_scene(path: str | os.PathLike[str], gravity: Any = None) -> ClimbScene:
    """The scene in a file; see the module for its form. Its name is the file's stem.

    What :func:`save_scene` wrote of a scene that was read is that scene to the last digit.

    Args:
        gravity: [m/s^2]; None: that of the file, and none where it says none.

    Raises:
        StructureFileError: a file that cannot be read, or a bad line: ``field`` names the line and the column.
        ShapeError, NotFiniteError: gravity that is not three finite numbers.
    """
    file = validation.file_path("path", path)
    text = validation.text_of("path", file, StructureFileError).removeprefix("\ufeff")
    section, header, reader = "footholds", tuple[str, ...](), _SceneReader(file.parent)
    for number, line in enumerate(text.splitlines(), start=1):
        if not line.strip() or line.lstrip().startswith("#"):
            continue
        if line.lstrip().startswith("["):
            section, header = _section(number, line), ()
            continue
        cells = _cells(number, line)
        if not header:
            header = _header(number, cells, section)
        elif len(cells) != len(header):
            reason = f"expected {len(header)} values, not {len(cells)}: {', '.join(header)}"
            raise StructureFileError(f"line {number}", ", ".join(cells), reason)
        else:
            reader.add(section, _SceneRow(number, dict(zip(header, cells, strict=True))))
    return reader.scene(file.stem, gravity)


def save_scene(scene: ClimbScene, path: str | os.PathLike[str]) -> pathlib.Path:
    """Writes a scene such that reading gives every number back within 1e-15 of its size; returns the file.

    A mesh or hull becomes a file beside it, NAME-K.npy for the K-th body.

    Raises:
        StructureFileError: the file cannot be written, or something of the scene has no place in one.
    """
    validation.instance("scene", scene, ClimbScene, "a ClimbScene")
    file, stream, meshes = validation.file_path("path", path), io.StringIO(), list[tuple[str, Array]]()
    own = {"on": bool(scene.bodies)}
    own |= {"friction": any(isfinite(f.friction) for f in scene.footholds)}
    own |= {"limbs": any(f.limbs for f in scene.footholds)}
    _write(stream, [*COLUMNS["footholds"][0], *(column for column, there in own.items() if there)])
    for f in scene.footholds:
        if f.rolls > MOST_ROLLS:
            raise StructureFileError(f"foothold {f.id}: rolls", f.rolls, f"expected at most {MOST_ROLLS}")
        friction = repr(f.friction) if isfinite(f.friction) else ""
        limbs = "; ".join(_named(f"foothold {f.id}: limbs", limb, ";") for limb in f.limbs)
        more = {"on": f.on or NO_BODY, "friction": friction, "limbs": limbs}
        roll = {0: "free", 1: "fixed"}.get(f.rolls, str(f.rolls))
        pose = pin.SE3(f.pose.rotation * _TURNED, f.pose.translation)
        _write(
            stream, [_named("foothold", f.id), *_numbers(pose), roll, *(more[c] for c, there in own.items() if there)]
        )
    if scene.bodies:
        stream.write("\n[obstacles]\n")
        _write(stream, COLUMNS["obstacles"][0])
    for k, (name, body) in enumerate(scene.bodies.items(), start=1):
        kind, sizes = _told(name, body.shape)
        if isinstance(sizes, np.ndarray):
            meshes.append((f"{_UNPLAIN.sub('_', file.stem)}-{k}.npy", sizes))
            sizes = [meshes[-1][0]]
        if name == NO_BODY:
            raise StructureFileError("body", name, "in a file this says that a foothold is on no body")
        _write(stream, [_named("body", name), kind, *_numbers(body.placement), *sizes, *[""] * (3 - len(sizes))])
    if scene.gravity.any():
        stream.write("\n[gravity]\n")
        _write(stream, COLUMNS["gravity"][0])
        _write(stream, [repr(float(x)) for x in scene.gravity])
    with validation.replacing("path", file, StructureFileError) as fresh:
        for mesh, numbers in meshes:
            np.save(file.with_name(mesh), numbers, allow_pickle=False)
        fresh.write_text(stream.getvalue(), encoding="utf-8", newline="")
    return file


class _SceneRow:
    """One line: its cells by column, read with errors that name both."""

    def __init__(self, number: int, cells: Mapping[str, str]) -> None:
        self.number, self.cells = number, cells

    def error(self, column: str, value: Any, reason: str, choices: Sequence[str] = ()) -> StructureFileError:
        return StructureFileError(f"line {self.number}: {column}", value, reason, choices)

    def cell(self, column: str) -> str:
        """What stands in a column that may be left out."""
        return self.cells.get(column, "")

    def name(self, column: str) -> str:
        text = self.cells[column]
        if not text or not text.isprintable():
            raise self.error(column, text, "expected a text on one line")
        return text

    def real(self, column: str, low: float = -inf, high: float = inf) -> float:
        value = self.cells[column]
        try:
            number = float(value)
        except ValueError as error:
            raise self.error(column, value, "expected a number") from error
        if not isfinite(number):
            raise self.error(column, value, "expected a finite number")
        if not low <= number <= high:
            bounds = f"of at least {low:g}" if high == inf else f"within [{low:g}, {high:.4g}]"
            raise self.error(column, value, f"expected a number {bounds}")
        return number

    def choice(self, column: str, choices: Sequence[str]) -> str:
        if self.cells[column] not in choices:
            raise self.error(column, self.cells[column], "unknown", choices)
        return self.cells[column]

    def pose(self) -> pin.SE3:
        """A frame; one whose axes are orthonormal to the last digits is not made so again."""
        position, axis, reference = (np.array([self.real(c) for c in _POSE[k : k + 3]]) for k in (0, 3, 6))
        for columns, vector in (("ax, ay, az", axis), ("rx, ry, rz", reference)):
            if not vector.any():
                raise self.error(columns, vector, "expected a direction: a vector of non-zero length")
        if max(abs(axis @ axis - 1.0), abs(reference @ reference - 1.0), abs(axis @ reference)) <= ORTHONORMAL:
            rotation = np.column_stack([reference, np.cross(axis, reference), axis])
        else:
            rotation = self.made("rx, ry, rz", lambda: frame_along("frame", position, axis, reference)).rotation
        # Adding 0 leaves no -0, which a file does not tell from 0
        return pin.SE3(rotation + 0.0, position + 0.0)

    def sizes(self, kind: str) -> list[float]:
        columns, count = [c for c in _SIZES if c in self.cells], _SOLIDS[kind][1]
        for column in columns[count:]:
            if self.cells[column]:
                raise self.error(column, self.cells[column], f"a {kind} has {count} sizes")
        return [self.real(column, low=0.0) for column in columns[:count]]

    def made(self, column: str, make: Callable[[], Any]) -> Any:
        """What ``make`` returns; its typed error becomes one about this line and column."""
        try:
            return make()
        except WbcError as error:
            raise self.error(column, error.value, error.reason) from error


class _SceneReader:
    """What the rows of a file make; paths of meshes count from ``folder``."""

    def __init__(self, folder: pathlib.Path) -> None:
        self.folder, self.gravity = folder, list[float]()
        self.footholds, self.bodies = dict[str, tuple[_SceneRow, Foothold]](), dict[str, SceneBody]()
        self.tilts = list[float]()

    def add(self, section: str, row: _SceneRow) -> None:
        if section == "footholds":
            foothold = self.foothold(row)
            if foothold.id in self.footholds:
                raise row.error("id", foothold.id, "two of this id")
            self.footholds[foothold.id] = row, foothold
        elif section == "gravity":
            if self.gravity:
                raise row.error("x", row.cells["x"], "a scene has one gravity")
            self.gravity = [row.real(column) + 0.0 for column in ("x", "y", "z")]
        else:
            name = SURFACE if section == "surface" else row.name("id")
            column = "shape" if section == "surface" else "id"
            if name in self.bodies:
                raise row.error(column, name, "two of this id")
            if name == NO_BODY:
                raise row.error(column, name, "this says that a foothold is on no body")
            kind = _SURFACES[row.choice("shape", tuple(_SURFACES))] if section == "surface" else ""
            self.bodies[name] = self.body(row, kind or row.choice("shape", (*_SOLIDS, *_OF_FILES)))

    def scene(self, name: str, gravity: Any) -> ClimbScene:
        """All of it."""
        if not self.footholds:
            raise StructureFileError("footholds", name, "the file has no foothold")
        there = [*self.bodies, NO_BODY]
        for row, foothold in self.footholds.values():
            if foothold.on and foothold.on not in there:
                raise row.error("on", foothold.on, "no body of this file", there)
        if self.tilts:
            warnings.warn(
                f"{name}: max_tilt: {len(self.tilts)} footholds let limbs lean by up to {max(self.tilts):.4g} rad, "
                "which no climb does: limbs hold without leaning",
                stacklevel=3,
            )
        footholds = self.mounted([foothold for _, foothold in self.footholds.values()])
        own = np.array(self.gravity or (0.0, 0.0, 0.0)) if gravity is None else gravity
        return ClimbScene(footholds, self.bodies, own, name)

    def foothold(self, row: _SceneRow) -> Foothold:
        pose, text = row.pose(), row.name("roll")
        rolls = {"free": 0, "fixed": 1}.get(text, int(text) if re.fullmatch("[0-9]{1,8}", text) else -1)
        if rolls < 0 or (text.isdecimal() and not 2 <= rolls <= MOST_ROLLS):
            raise row.error("roll", text, f"expected free, fixed or a whole number from 2 to {MOST_ROLLS}")
        if row.cell("max_tilt") and row.real("max_tilt", 0.0, pi / 2) > 0.0:
            self.tilts.append(row.real("max_tilt"))
        friction = row.real("friction", 0.0) if row.cell("friction") else inf
        if not row.cell("limbs").isprintable():
            raise row.error("limbs", row.cell("limbs"), "expected a text on one line")
        limbs = tuple(limb.strip() for limb in row.cell("limbs").split(";") if limb.strip())
        frame = pin.SE3(pose.rotation * _TURNED + 0.0, pose.translation)
        name, on = row.name("id"), row.cell("on")
        made: Foothold = row.made("friction", lambda: Foothold(name, frame, on, friction, limbs, rolls))
        return made

    def body(self, row: _SceneRow, kind: str) -> SceneBody:
        pose = row.pose()
        if kind in _OF_FILES:
            return SceneBody(self.shape(row, kind), pose)
        sizes, make = row.sizes(kind), _SOLIDS[kind][0]
        given: list[Any] = [tuple(sizes)] if make in (Box, Ellipsoid) else sizes
        solid: Shape = row.made("d1, d2, d3", lambda: make(*given))
        return SceneBody(solid, pose)

    def shape(self, row: _SceneRow, kind: str) -> Shape:
        """A mesh, a sheet or a hull out of its file."""
        path, scale = row.name("d1"), row.real("d2", low=0.0) if row.cells["d2"] else 1.0
        if row.cells["d3"]:
            raise row.error("d3", row.cells["d3"], f"a {kind} has a file and a scale")
        if "\0" in path or pathlib.Path(path).suffix.lower() not in _ENDINGS:
            raise row.error("d1", path, f"expected a file {', '.join(_ENDINGS)}")
        if not validation.is_file("d1", self.folder / path):
            raise row.error("d1", path, "there is no such file")
        if scale == 0.0:
            raise row.error("d2", row.cells["d2"], "expected a scale above 0")
        made: Shape = row.made("d1", lambda: _shape_of(kind, self.folder / path, scale))
        return made

    def mounted(self, footholds: Sequence[Foothold]) -> list[Foothold]:
        """Those that do not say what they are on, on the body next to them."""
        points = np.array([foothold.pose.translation for foothold in footholds])
        away = [*(np.abs(body.distances(points)) for body in self.bodies.values()), np.full(len(points), MOUNTED)]
        names = [*self.bodies, NO_BODY]
        on = [f.on or names[k] for f, k in zip(footholds, np.argmin(away, axis=0), strict=True)]
        return [replace(f, on="" if name == NO_BODY else name) for f, name in zip(footholds, on, strict=True)]


def _shape_of(kind: str, file: pathlib.Path, scale: float) -> Shape:
    if file.suffix.lower() != ".npy":
        mesh = TriangleMesh.read(file, scale, solid=kind == "mesh")
        return Convex(mesh.corners.reshape(-1, 3)) if kind == "convex" else mesh
    try:
        numbers = scale * np.asarray(np.load(file, allow_pickle=False), dtype=np.float64)
    except (OSError, ValueError, EOFError, TypeError) as error:
        raise StructureFileError("file", str(file), f"cannot be read: {error}") from error
    return Convex(numbers.reshape(-1, 3)) if kind == "convex" else TriangleMesh(numbers, solid=kind == "mesh")


def _told(name: str, shape: Any) -> tuple[str, Any]:
    """Shape and sizes of a body, or its corners."""
    if isinstance(shape, TriangleMesh):
        return "mesh" if shape.solid else "sheet", shape.corners
    if isinstance(shape, Convex):
        return "convex", shape.points
    kind = next((kind for kind, (cls, _) in _SOLIDS.items() if type(shape) is cls), None)
    if kind is None:
        reason = f"a file has no {type(shape).__name__}: give TriangleMesh(shape.triangles())"
        raise StructureFileError(f"body {name}", shape, reason, (*_SOLIDS, *_OF_FILES))
    return kind, [repr(float(x)) for field in fields(shape) for x in np.ravel(getattr(shape, field.name))]


def _section(number: int, line: str) -> str:
    name, known = line.split("#")[0].strip().strip(",").strip(), [f"[{section}]" for section in list(COLUMNS)[1:]]
    if name not in known:
        raise StructureFileError(f"line {number}", name, "no such section", known)
    return name.strip("[]")


def _cells(number: int, line: str) -> list[str]:
    try:
        return [cell.strip() for cell in next(csv.reader([line], skipinitialspace=True, strict=True))]
    except csv.Error as error:
        raise StructureFileError(f"line {number}", line.strip(), f"cannot be read: {error}") from error


def _header(number: int, cells: Sequence[str], section: str) -> tuple[str, ...]:
    """The columns of a section, in the order of the file."""
    needed, more = COLUMNS[section]
    if len(set(cells)) != len(cells) or not set(needed) <= set(cells) <= {*needed, *more}:
        reason = f"expected the columns {', '.join(needed)}" + (f" and any of {', '.join(more)}" if more else "")
        raise StructureFileError(f"line {number}", ", ".join(cells), reason)
    return tuple(cells)


def _named(field: str, text: str, without: str = "\n") -> str:
    """A name that a file can hold."""
    if text != text.strip() or not text.isprintable() or without in text:
        raise StructureFileError(field, text, f"a file has texts on one line, without {without!r} and blanks around it")
    return text


def _write(stream: io.StringIO, cells: Sequence[str]) -> None:
    """A row; texts are quoted where they would be read as something else."""
    stream.write(",".join(map(_quoted, cells)) + "\n")


def _quoted(text: str) -> str:
    if text[:1] in ("#", "[") or any(sign in text for sign in ',"'):
        return '"' + text.replace('"', '""') + '"'
    return text


def _numbers(pose: pin.SE3) -> list[str]:
    vectors = (pose.translation, pose.rotation[:, 2], pose.rotation[:, 0])
    return [repr(float(x) + 0.0) for vector in vectors for x in vector]
