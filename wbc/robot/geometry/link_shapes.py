"""Collision shapes of links: read from the description, or fitted to its meshes."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from wbc import validation
from wbc.errors import RobotFileError, ShapeError
from wbc.multibody import pin
from wbc.robot.geometry.bodies import CollisionBody, bodies_of
from wbc.robot.robot import Robot, changed
from wbc.robot.sources.kinds import is_mjmodel
from wbc.shapes import PlacedShape

if TYPE_CHECKING:
    from mujoco import MjModel

    from wbc.robot.geometry.convex_parts import ConvexParts
    from wbc.robot.geometry.styles import Style


def description_shapes(
    robot: Robot, package_dirs: Iterable[Any] = (), *, exact: bool = False, geometry: Any = None
) -> Robot:
    """A copy whose shapes are those of the description's primitives; links with meshes are named in the notes.

    A sphere stays a sphere and a capsule a capsule. A cylinder, box or ellipsoid becomes the least capsule on its
    longest axis that contains it, with ``excess`` [m] the exact Hausdorff distance of the two; with ``exact`` a
    cylinder, box or ellipsoid stays itself. A height field stays a height map.

    Raises:
        RobotFileError: the robot was not read from a file, or the file cannot be read any more.
        RangeError: a box or cylinder of size 0, which has no exact shape.
    """
    bodies = bodies_of(robot, package_dirs, geometry)
    meshes = [b.link for b in bodies if b.mesh]
    shapes: dict[str, tuple[PlacedShape, ...]] = {}
    problems: list[str] = []
    if primitives := [b for b in bodies if not b.mesh]:
        from wbc.robot.geometry.styles import Style

        shapes, problems = _collect(primitives, Style("convex" if exact else "capsule"))
    parts = [_counted(shapes, "from the description")]
    if meshes:
        parts.append(f"meshes, not read (fit_shapes does): {', '.join(dict.fromkeys(meshes))}")
    return _with(robot, shapes, [*parts, *problems])


def fit_shapes(
    robot: Robot,
    links: Sequence[str] | None = None,
    *,
    kind: str = "capsule",
    count: int | None = None,
    tolerance: float = 0.0,
    package_dirs: Iterable[Any] = (),
    geometry: pin.GeometryModel | MjModel | None = None,
) -> Robot:
    """A copy whose links carry shapes that contain the description's collision bodies.

    ======== ====================================================== ==================================================
    kind     a mesh                                                 a box or cylinder (an ellipsoid alike)
    ======== ====================================================== ==================================================
    capsule  its least capsule; with ``count`` > 1 cut into slabs   as in :func:`description_shapes`, or slabs
             with a capsule each
    spheres  cut into slabs with a sphere each                      the same
    convex   the hull of each connected component                   a Box, Cylinder or Ellipsoid
    ======== ====================================================== ==================================================

    Spheres, capsules and height maps stay themselves. ``excess`` [m] is how far a shape stands out of the hull of the
    body (for convex parts 0): exact for meshes and boxes, see ``Hull``; an upper bound for spheres and for several
    capsules around cylinders and ellipsoids, which are fitted to a polyhedron around them.

    Args:
        robot: a robot that was read from a URDF or MJCF file, or any with ``geometry``.
        links: frames of the links to do; the shapes of the others stay as they are. Default: all links.
        kind: ``capsule``, ``spheres`` or ``convex``.
        count: most shapes a body, up to 32; default 1 capsule,
            4 spheres. More are taken only where they stand out less.
        tolerance: fewer do where they stand out by at most this [m].
        package_dirs: folders to look for ``package://NAME/...`` in, besides the folders above the file.
        geometry: a collision model of the same links, or a ``mujoco.MjModel``, to use instead of the file's.

    Raises:
        UnknownNameError: a link or kind that does not exist.
        ShapeError, RangeError, NotFiniteError: a bad count or tolerance; a box or cylinder of size 0, for ``convex``.
        RobotFileError: no file and no ``geometry``.

    Cannot do: a mesh that is missing or in a format that coal cannot read gets no shape, and one without volume no
    convex part; ``notes["shapes"]`` names the link and the reason. Shapes around an open mesh contain its surface. A
    capsule may stand out of a bulky link by several centimetres: look at ``excess``.
    """
    from wbc.robot.geometry.styles import Style

    validation.instance("robot", robot, Robot, "a wbc Robot, see wbc.robots.load")
    if links is not None:
        links = validation.strings("links", links)
        for link in links:
            robot.check_frame("links", link)
    if geometry is not None and not is_mjmodel(geometry):
        validation.instance("geometry", geometry, pin.GeometryModel, "a pin.GeometryModel or a mujoco.MjModel")
    style = Style(kind, count, tolerance)
    bodies = bodies_of(robot, package_dirs, geometry)
    shapes, problems = _collect([b for b in bodies if links is None or b.link in links], style)
    if links is not None:
        shapes = {k: v for k, v in robot.shapes.items() if k not in links} | shapes
    return _with(robot, shapes, [_counted(shapes, "fitted to the description's bodies"), *problems])


def convex_parts(mesh: Any, triangles: Any = None, *, scale: Any = 1.0) -> ConvexParts:
    """The hulls of a mesh's connected components, for obstacles and links.

    Args:
        mesh: path of a file that Coal's loader reads (STL, OBJ, DAE, ...), or vertices n x 3 [m].
        triangles: with vertices, m x 3 of their numbers.
        scale: factor of the vertices, one number or three.

    Returns:
        ``parts`` and ``remarks``; see ``parts_of`` for what happens to components without
        volume.

    Raises:
        RobotFileError: a file that is missing or unreadable, or a mesh of no volume.
        ShapeError, NotFiniteError: bad vertices, triangles or scale.

    Example:
        >>> import numpy as np, wbc
        >>> corners = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])
        >>> faces = [[0, 1, 2], [0, 1, 3], [0, 2, 3], [1, 2, 3]]
        >>> len(wbc.robots.convex_parts(np.vstack([corners, corners + 2]), faces + [[4, 5, 6], [4, 5, 7]]).parts)
        2
    """
    from wbc.robot.geometry.convex_parts import parts_of
    from wbc.robot.geometry.meshes import Mesh, read_mesh

    alike = validation.dimensions("scale", scale) == ()
    factor = validation.ordinary_array("scale", [scale] * 3 if alike else scale, (3,))
    if triangles is None:
        return parts_of(read_mesh(validation.file_path("mesh", mesh), factor))
    vertices = validation.ordinary_array("mesh", mesh)
    if vertices.ndim != 2 or vertices.shape[1] != 3 or len(vertices) == 0:
        raise ShapeError("mesh", vertices.shape, "expected vertices, n x 3")
    validation.dimensions("triangles", triangles)
    faces = np.asarray(triangles)
    if faces.ndim != 2 or faces.shape[1] != 3 or faces.dtype.kind not in "iu":
        raise ShapeError("triangles", triangles, "expected whole numbers, m x 3")
    if faces.size and not (faces.min() >= 0 and faces.max() < len(vertices)):
        raise ShapeError("triangles", triangles, f"expected numbers of vertices, 0 to {len(vertices) - 1}")
    return parts_of(Mesh(vertices * factor, faces.astype(np.intp)))


def _collect(bodies: Iterable[CollisionBody], style: Style) -> tuple[dict[str, tuple[PlacedShape, ...]], list[str]]:
    """Shapes by link, and one sentence for each body that has none, or a component without a part of its own."""
    shapes: dict[str, tuple[PlacedShape, ...]] = {}
    problems = []
    for body in bodies:
        try:
            made, remarks = style.shapes(body.read(), body.placement)
            shapes[body.link] = (*shapes.get(body.link, ()), *made)
            problems += [f"{body.link}: {remark}" for remark in remarks]
        except RobotFileError as error:
            problems.append(f"{body.link}: {error}")
    return shapes, problems


def _counted(shapes: dict[str, tuple[PlacedShape, ...]], words: str) -> str:
    every = [s for group in shapes.values() for s in group]
    if not every:
        return "none in the description"
    return f"{len(every)} shapes on {len(shapes)} links {words}, largest excess {max(s.excess for s in every):.4g} m"


def _with(robot: Robot, shapes: dict[str, tuple[PlacedShape, ...]], sentences: list[str]) -> Robot:
    return changed(robot.with_shapes(shapes), notes={**robot.notes, "shapes": "; ".join(sentences)})
