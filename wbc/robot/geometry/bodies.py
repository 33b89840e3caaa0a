"""Collision bodies of a description, as URDF files and Pinocchio's geometry models give them."""

from __future__ import annotations

import pathlib
import xml.etree.ElementTree as ElementTree
from collections.abc import Callable, Iterable, Sequence
from functools import partial
from typing import Any

import numpy as np

from wbc import validation
from wbc.errors import RobotFileError, ShapeError
from wbc.multibody import own, pin
from wbc.quick_dataclasses import dataclass
from wbc.robot.geometry.meshes import Mesh, hull_mesh, mesh_of, read_mesh
from wbc.robot.robot import Robot
from wbc.robot.sources.files import read_xml
from wbc.robot.sources.kinds import is_mjmodel
from wbc.shapes import Capsule, HeightMap, Sphere
from wbc.validation import Array


@dataclass(frozen=True, eq=False)
class RawBox:
    """A box of half sides ``half`` [m], which may be 0."""

    half: Array


@dataclass(frozen=True)
class RawCylinder:
    """A cylinder about z of half length ``half`` [m]; both numbers may be 0."""

    radius: float
    half: float


@dataclass(frozen=True, eq=False)
class RawEllipsoid:
    """An ellipsoid of semi-axes ``radii`` [m]."""

    radii: Array


Raw = Sphere | Capsule | HeightMap | RawBox | RawCylinder | RawEllipsoid | Mesh


@dataclass(frozen=True, eq=False)
class CollisionBody:
    """One collision body of a link.

    Attributes:
        link: frame of the link.
        mesh: whether a mesh must be read for it.
        placement: pose of the body in that frame.
        read: the body in its own frame, or :class:`RobotFileError` with the reason why there is none.
    """

    link: str
    mesh: bool
    placement: own.SE3
    read: Callable[[], Raw]


def bodies_of(robot: Robot, package_dirs: Iterable[Any] = (), geometry: Any = None) -> list[CollisionBody]:
    """The collision bodies of the file that a robot was read from, or of the root element of such a URDF file, a
    ``pin.GeometryModel`` or a ``mujoco.MjModel``.

    Raises:
        RobotFileError: no file and no ``geometry``, or the file cannot be read any more.
    """
    if is_mjmodel(geometry):
        return _mujoco_bodies(robot, geometry)
    if geometry is not None and not ElementTree.iselement(geometry):
        return _geometry_bodies(robot.model, geometry)
    if not robot.source:
        raise RobotFileError("robot.source", robot.source, "the robot was not read from a file: there are no bodies")
    path = pathlib.Path(robot.source)
    tree = read_xml(path)[1] if geometry is None else geometry
    if tree.tag == "mujoco":
        from wbc.robot.sources.mjmodel import compiled

        return _mujoco_bodies(robot, compiled(path))
    folders = [
        validation.file_path("package_dirs", folder)
        for folder in validation.items("package_dirs", package_dirs, "folders")
    ]
    return [
        _urdf_body(str(link.get("name")), collision, shape, path, folders)
        for link in tree.findall("link")
        for collision in link.findall("collision")
        if (shape := collision.find("geometry/*")) is not None
    ]


def _urdf_body(
    link: str,
    collision: ElementTree.Element,
    shape: ElementTree.Element,
    path: pathlib.Path,
    folders: list[pathlib.Path],
) -> CollisionBody:
    """The body of one <collision> element, whose geometry is ``shape``."""
    origin = collision.find("origin")
    xyz = _numbers(origin.get("xyz", "0 0 0") if origin is not None else "0 0 0", link)
    rpy = _numbers(origin.get("rpy", "0 0 0") if origin is not None else "0 0 0", link)

    def number(key: str) -> float:
        return validation.scalar(f"{link}.{key}", float(shape.get(key, "nan")), low=0.0, unit="m")

    def read() -> Raw:
        if shape.tag == "sphere":
            return Sphere(number("radius"))
        if shape.tag == "capsule":
            return Capsule(number("radius"), number("length"))
        if shape.tag == "cylinder":
            return RawCylinder(number("radius"), number("length") / 2)
        if shape.tag == "box":
            return RawBox(_numbers(shape.get("size", ""), link) / 2)
        if shape.tag == "mesh":
            file = resolve_mesh(shape.get("filename", ""), path, folders)
            return read_mesh(file, _numbers(shape.get("scale", "1 1 1"), link))
        raise RobotFileError("geometry", shape.tag, "neither sphere, capsule, cylinder, box nor mesh")

    return CollisionBody(link, shape.tag == "mesh", own.SE3(own.rpy.rpyToMatrix(rpy), xyz), read)


def _numbers(text: str, link: str) -> Array:
    try:
        return validation.real_array(f"{link}.geometry", [float(x) for x in text.split()], (3,))
    except (ValueError, ShapeError) as error:
        raise RobotFileError(f"{link}.geometry", text, "expected three numbers") from error


def resolve_mesh(name: str, source: pathlib.Path, folders: Sequence[pathlib.Path]) -> pathlib.Path:
    """Where a mesh file is that a description names as ``package://NAME/...``, ``file://...`` or a path.

    Packages are looked for in ``folders``, then in every folder above the description.

    Raises:
        RobotFileError: nowhere.
    """
    if name.startswith("package://"):
        relative = name.removeprefix("package://").lstrip("/")
        for folder in [*folders, *source.parents]:
            if (folder / relative).is_file():
                return folder / relative
        raise RobotFileError("mesh", name, "not found in the package folders or above the description")
    path = pathlib.Path(name.removeprefix("file://"))
    return path if path.is_absolute() else source.parent / path


def _geometry_bodies(model: pin.Model, geometry: pin.GeometryModel) -> list[CollisionBody]:
    """Bodies of a Pinocchio collision model, placed in the frames of their links."""
    import coal

    bodies = []
    for item in geometry.geometryObjects:
        frame = model.frames[item.parentFrame]
        local = own.SE3(frame.placement.inverse() * item.placement)
        mesh = isinstance(item.geometry, (coal.BVHModelBase, coal.ConvexBase))
        bodies.append(CollisionBody(str(frame.name), mesh, local, partial(raw_of, item.geometry)))
    return bodies


def _mujoco_bodies(robot: Robot, model: Any) -> list[CollisionBody]:
    """Geoms of a compiled model that can touch something, on links of the robot that move or do not."""
    from wbc.robot.sources.mjnames import names_of, pose_of

    bodies, names = [], names_of(model).bodies
    pairs = {*model.pair_geom1.tolist(), *model.pair_geom2.tolist()}
    for g in range(model.ngeom):
        link = names[int(model.geom_bodyid[g])]
        touches = model.geom_contype[g] or model.geom_conaffinity[g] or g in pairs
        if touches and robot.tree.existFrame(link):
            placement, mesh = pose_of(model.geom_pos[g], model.geom_quat[g]), int(model.geom_type[g]) == _MESH
            bodies.append(CollisionBody(link, mesh, placement, partial(_from_geom, model, g)))
    return bodies


def _from_geom(model: Any, g: int) -> Raw:
    """The body of a geom, in its own frame."""
    kind, size = int(model.geom_type[g]), np.array(model.geom_size[g])
    if kind == _MESH:
        mesh = int(model.geom_dataid[g])
        vertices = slice(int(model.mesh_vertadr[mesh]), int(model.mesh_vertadr[mesh] + model.mesh_vertnum[mesh]))
        faces = slice(int(model.mesh_faceadr[mesh]), int(model.mesh_faceadr[mesh] + model.mesh_facenum[mesh]))
        return Mesh(np.array(model.mesh_vert[vertices], dtype=float), np.array(model.mesh_face[faces], dtype=np.intp))
    if kind == _HEIGHTS:
        k = int(model.geom_dataid[g])
        x, y, rise, base = (float(s) for s in model.hfield_size[k])
        shape, start = (int(model.hfield_nrow[k]), int(model.hfield_ncol[k])), int(model.hfield_adr[k])
        data = np.array(model.hfield_data[start : start + shape[0] * shape[1]], dtype=float)
        return HeightMap(rise * data.reshape(shape), (2.0 * x, 2.0 * y), base)
    if kind not in _GEOMS:
        raise RobotFileError("geom", model.geom(g).name, "no shape is fitted to planes and signed distance fields")
    return _GEOMS[kind](size)


#: MuJoCo's number of height fields among kinds of geoms
_HEIGHTS = 1
#: MuJoCo's number of meshes among kinds of geoms
_MESH = 7
_GEOMS: dict[int, Callable[[Array], Raw]] = {
    2: lambda size: Sphere(float(size[0])),
    3: lambda size: Capsule(float(size[0]), 2.0 * float(size[1])),
    4: RawEllipsoid,
    5: lambda size: RawCylinder(float(size[0]), float(size[1])),
    6: RawBox,
}


def raw_of(geometry: Any) -> Raw:
    """The body of a Coal geometry.

    Raises:
        RobotFileError: an unbounded body, or a kind that is not known here.
    """
    import coal

    if isinstance(geometry, coal.Sphere):
        return Sphere(geometry.radius)
    if isinstance(geometry, coal.Capsule):
        return Capsule(geometry.radius, 2 * geometry.halfLength)
    if isinstance(geometry, coal.Cylinder):
        return RawCylinder(geometry.radius, geometry.halfLength)
    if isinstance(geometry, coal.Box):
        return RawBox(np.array(geometry.halfSide))
    if isinstance(geometry, coal.Ellipsoid):
        return RawEllipsoid(np.array(geometry.radii))
    if isinstance(geometry, coal.BVHModelBase):
        return mesh_of(geometry)
    if isinstance(geometry, coal.ConvexBase):
        return hull_mesh(np.array(geometry.points()))
    raise RobotFileError("geometry", type(geometry).__name__, "no shape is fitted to this kind of body")
