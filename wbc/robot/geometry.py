"""Collision shapes of links: read from the description, or fitted to its meshes."""

from __future__ import annotations

import pathlib
import xml.etree.ElementTree as ElementTree
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import coal
import numpy as np
import pinocchio as pin

from wbc import validation
from wbc.errors import RobotFileError, ShapeError
from wbc.robot import fitting
from wbc.robot.files import PARSER_ERRORS, captured_stderr, read_xml
from wbc.robot.mjcf import read_mjcf_geometry
from wbc.robot.robot import Robot
from wbc.shapes import Capsule, PlacedShape, Sphere
from wbc.validation import Array


@dataclass(frozen=True, eq=False)
class Body:
    """One collision body of a link. ``shape`` makes its sphere or capsule in the link's frame, or raises
    :class:`RobotFileError` with the reason why there is none; ``mesh`` says whether vertices must be read for it.
    """

    link: str
    mesh: bool
    shape: Callable[[], PlacedShape]


def description_shapes(robot: Robot, package_dirs: Iterable[Any] = ()) -> Robot:
    """A copy whose shapes are those of the description's primitives; links with meshes are named in the notes.

    A sphere stays a sphere and a capsule a capsule. A cylinder, box or ellipsoid becomes the least capsule on its
    longest axis that contains it, with ``excess`` [m] the exact Hausdorff distance of the two.

    Raises:
        RobotFileError: the robot was not read from a file, or the file cannot be read any more.
    """
    bodies = _bodies(robot, package_dirs)
    meshes = [b.link for b in bodies if b.mesh]
    shapes, problems = _collect([b for b in bodies if not b.mesh])
    parts = [_counted(shapes, "from the description")]
    if meshes:
        parts.append(f"meshes, not read (fit_shapes does): {', '.join(dict.fromkeys(meshes))}")
    return _with(robot, shapes, [*parts, *problems])


def fit_shapes(
    robot: Robot,
    links: Sequence[str] | None = None,
    *,
    package_dirs: Iterable[Any] = (),
    geometry: pin.GeometryModel | None = None,
) -> Robot:
    """A copy whose links carry spheres and capsules: primitives as in :func:`description_shapes`, and around every
    collision mesh the capsule of :func:`~wbc.robot.fitting.fit_capsule`.

    Args:
        robot: a robot that was read from a URDF or MJCF file, or any with ``geometry``.
        links: frames of the links to do; the shapes of the others stay as they are. Default: all links.
        package_dirs: folders to look for ``package://NAME/...`` in, besides the folders above the file.
        geometry: a collision model of the same links to use instead of the file's.

    Raises:
        UnknownNameError: a link that does not exist.
        RobotFileError: no file and no ``geometry``.

    Cannot do: a mesh that is missing or in a format that coal cannot read gets no shape; ``notes["shapes"]`` names
    the link and the reason. A capsule may stand out of a bulky link by several centimetres: look at ``excess``.
    """
    for link in links or ():
        robot.check_frame("links", link)
    bodies = _geometry_bodies(robot.model, geometry) if geometry is not None else _bodies(robot, package_dirs)
    chosen = [b for b in bodies if links is None or b.link in links]
    shapes, problems = _collect(chosen)
    if links is not None:
        shapes = {k: v for k, v in robot.shapes.items() if k not in links} | shapes
    return _with(robot, shapes, [_counted(shapes, "fitted to the description's bodies"), *problems])


def mesh_vertices(path: pathlib.Path, scale: Array) -> Array:
    """Vertices of a mesh file, n x 3 [m].

    Raises:
        RobotFileError: missing, unreadable or empty.
    """
    if not path.is_file():
        raise RobotFileError("mesh", str(path), "there is no such file")
    try:
        with captured_stderr() as noise:
            vertices = np.array(coal.MeshLoader().load(str(path), scale).vertices(), dtype=np.float64)
    except PARSER_ERRORS as error:
        raise RobotFileError("mesh", str(path), noise.reason or " ".join(str(error).split())) from error
    if vertices.ndim != 2 or len(vertices) == 0 or not np.isfinite(vertices).all():
        raise RobotFileError("mesh", str(path), "no finite vertices in it")
    return vertices


def _collect(bodies: Iterable[Body]) -> tuple[dict[str, tuple[PlacedShape, ...]], list[str]]:
    """Shapes by link, and one sentence for each body that has none."""
    shapes: dict[str, tuple[PlacedShape, ...]] = {}
    problems = []
    for body in bodies:
        try:
            shapes[body.link] = (*shapes.get(body.link, ()), body.shape())
        except RobotFileError as error:
            problems.append(f"{body.link}: {error}")
    return shapes, problems


def _counted(shapes: dict[str, tuple[PlacedShape, ...]], words: str) -> str:
    every = [s for group in shapes.values() for s in group]
    if not every:
        return "none in the description"
    return f"{len(every)} shapes on {len(shapes)} links {words}, largest excess {max(s.excess for s in every):.4g} m"


def _with(robot: Robot, shapes: dict[str, tuple[PlacedShape, ...]], sentences: list[str]) -> Robot:
    return replace(robot.with_shapes(shapes), notes={**robot.notes, "shapes": "; ".join(sentences)})


def _bodies(robot: Robot, package_dirs: Iterable[Any]) -> list[Body]:
    if not robot.source:
        raise RobotFileError("robot.source", robot.source, "the robot was not read from a file: there are no bodies")
    path = pathlib.Path(robot.source)
    _, tree = read_xml(path)
    if tree.tag == "mujoco":
        return _geometry_bodies(*read_mjcf_geometry(path))
    folders = [pathlib.Path(folder) for folder in package_dirs]
    return [
        _urdf_body(str(link.get("name")), collision, path, folders)
        for link in tree.findall("link")
        for collision in link.findall("collision")
        if collision.find("geometry") is not None and len(collision.find("geometry") or ())
    ]


def _urdf_body(link: str, collision: ElementTree.Element, path: pathlib.Path, folders: list[pathlib.Path]) -> Body:
    """The body of one <collision> element."""
    origin, shape = collision.find("origin"), collision.find("geometry")[0]  # type: ignore[index]
    xyz = _numbers(origin.get("xyz", "0 0 0") if origin is not None else "0 0 0", link)
    rpy = _numbers(origin.get("rpy", "0 0 0") if origin is not None else "0 0 0", link)
    placement = pin.SE3(pin.rpy.rpyToMatrix(rpy), xyz)

    def number(key: str) -> float:
        return validation.scalar(f"{link}.{key}", float(shape.get(key, "nan")), low=0.0, unit="m")

    def make() -> PlacedShape:
        if shape.tag == "sphere":
            return PlacedShape(Sphere(number("radius")), placement)
        if shape.tag == "capsule":
            return PlacedShape(Capsule(number("radius"), number("length")), placement)
        if shape.tag == "cylinder":
            return _cylinder(number("radius"), number("length") / 2, placement)
        if shape.tag == "box":
            return _box(_numbers(shape.get("size", ""), link) / 2, placement)
        if shape.tag == "mesh":
            file = resolve_mesh(shape.get("filename", ""), path, folders)
            vertices = mesh_vertices(file, _numbers(shape.get("scale", "1 1 1"), link))
            return fitting.fit_capsule(vertices @ placement.rotation.T + placement.translation)
        raise RobotFileError("geometry", shape.tag, "neither sphere, capsule, cylinder, box nor mesh")

    return Body(link, shape.tag == "mesh", make)


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


def _geometry_bodies(model: pin.Model, geometry: pin.GeometryModel) -> list[Body]:
    """Bodies of a Pinocchio collision model, placed in the frames of their links."""
    bodies = []
    for item in geometry.geometryObjects:
        frame = model.frames[item.parentFrame]
        local = frame.placement.inverse() * item.placement
        mesh = isinstance(item.geometry, (coal.BVHModelBase, coal.ConvexBase))
        name = str(frame.name)
        bodies.append(Body(name, mesh, lambda g=item.geometry, p=local: _coal_shape(g, p)))  # type: ignore[misc]
    return bodies


def _coal_shape(geometry: Any, placement: pin.SE3) -> PlacedShape:
    """The sphere or capsule for a coal geometry.

    Raises:
        RobotFileError: an unbounded body, or a kind that no capsule is fitted to.
    """
    if isinstance(geometry, coal.Sphere):
        return PlacedShape(Sphere(geometry.radius), placement)
    if isinstance(geometry, coal.Capsule):
        return PlacedShape(Capsule(geometry.radius, 2 * geometry.halfLength), placement)
    if isinstance(geometry, coal.Cylinder):
        return _cylinder(geometry.radius, geometry.halfLength, placement)
    if isinstance(geometry, coal.Box):
        return _box(np.array(geometry.halfSide), placement)
    if isinstance(geometry, coal.Ellipsoid):
        radii = np.array(geometry.radii)
        radius, half, gap = fitting.around_ellipsoid(radii)
        return _capsule(radius, half, placement * _axis_to_z(int(np.argmax(radii))), gap)
    if isinstance(geometry, coal.BVHModelBase):
        vertices = np.array(geometry.vertices())
        return fitting.fit_capsule(vertices @ placement.rotation.T + placement.translation)
    if isinstance(geometry, coal.ConvexBase):
        vertices = np.array(geometry.points())
        return fitting.fit_capsule(vertices @ placement.rotation.T + placement.translation)
    raise RobotFileError("geometry", type(geometry).__name__, "no sphere or capsule is fitted to this kind of body")


def _cylinder(radius: float, half: float, placement: pin.SE3) -> PlacedShape:
    r, h, gap = fitting.around_cylinder(radius, half)
    return _capsule(r, h, placement, gap)


def _box(half: Array, placement: pin.SE3) -> PlacedShape:
    longest = int(np.argmax(half))
    across = np.delete(half, longest)
    r, h, gap = fitting.around_cylinder(float(np.hypot(*across)), float(half[longest]), float(across.min()))
    return _capsule(r, h, placement * _axis_to_z(longest), gap)


def _capsule(radius: float, half: float, placement: pin.SE3, gap: float) -> PlacedShape:
    if half <= 0.0:
        return PlacedShape(Sphere(radius), placement, gap)
    return PlacedShape(Capsule(radius, 2 * half), placement, gap)


def _axis_to_z(axis: int) -> pin.SE3:
    """A rotation whose z axis is the given axis."""
    return pin.SE3(np.roll(np.eye(3), 2 - axis, axis=1), np.zeros(3))
