"""Pictures put together from robots, shapes and paths."""

from __future__ import annotations

import fnmatch
import math
import pathlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray

from wbc import style, validation
from wbc.errors import RangeError, RobotFileError, ShapeError
from wbc.multibody import pin
from wbc.robot import Robot
from wbc.robot.robot import checked_robot
from wbc.shapes import Convex, PlacedShape, Solid, Sphere
from wbc.shapes.names import names_of_shapes
from wbc.track import render
from wbc.track.clearance import bodies_of
from wbc.validation import Array

Colour = tuple[float, float, float]

WHITE: Colour = (0.93, 0.935, 0.945)
DARK: Colour = (0.34, 0.36, 0.40)
PATH: Colour = (0.12, 0.40, 0.75)
ELBOW: Colour = (0.90, 0.50, 0.10)
OBSTACLE: Colour = (0.86, 0.27, 0.22)
#: Tint of what is drawn pale, and how much of it is seen
TINT: Colour = (0.62, 0.74, 0.90)
GHOST = 0.32
SUPERSAMPLING = 2
#: Surfaces nearer to each other than this count as one [m]
BIAS = 0.003
#: Largest angle above or below the scene: straight from above no direction is up [rad]
HIGHEST = 1.5
#: Corners closer than this are never merged [m]
FINEST = 1e-6
#: Pixels of a picture, at most
PIXELS = 2**24
#: Lengths of a radius along a path, at most
STATIONS = 1_000_000
#: Links whose poses differ by less stand at one place
SAME = 1e-3


class Scene:
    """What a picture shows. Robots, shapes and paths are added; :meth:`save` draws them.

    Example:
        >>> scene = Scene(robot)
        >>> scene.add_robot(q)
        >>> scene.add_shape(wbc.shapes.Sphere(0.1), pose, "ball")
        >>> scene.add_path(points, "path of the hand")
        >>> scene.save("runs/picture.png")

    Args:
        robot: the robot that is drawn with the visual meshes of its URDF, else with its link shapes.
        dark: frames whose links are drawn dark, as the hands, with everything that the same joint moves.
        detail: corners of meshes closer than this are drawn as one [m]; saves time on descriptions with fine meshes.
        hidden: links that are not drawn, by name or pattern such as ``leg_*``.
        colours: name or pattern of links -> their colour; the last that fits counts.
        floor: whether there is a floor under everything.

    Raises:
        UnknownNameError: no such frame. ShapeError, RangeError, NotFiniteError, RotationError: bad numbers, here and in
            the methods, or a shape without a surface.
    """

    def __init__(
        self,
        robot: Robot,
        dark: Sequence[str] = (),
        detail: float = 0.0,
        hidden: Sequence[str] = (),
        colours: Mapping[str, Colour] | None = None,
        floor: bool = True,
    ) -> None:
        detail = validation.scalar("Scene.detail", detail, low=0.0, unit="m")
        # What is finer than a thousandth of a millimetre merges nothing that can be seen
        detail = detail if detail >= FINEST else 0.0
        floor = validation.flag("Scene.floor", floor)
        dark, hidden = (validation.items(f"Scene.{n}", v, "names") for n, v in (("dark", dark), ("hidden", hidden)))
        shades = {
            p: _colour(c)
            for p, c in validation.mapping(
                "Scene.colours", {} if colours is None else colours, "links to colours"
            ).items()
        }
        checked_robot(robot)
        frames = [robot.model.getFrameId(robot.check_frame("Scene.dark", frame)) for frame in dark]
        self._robot = robot
        unseen = _matching(robot, "hidden", hidden)
        self._floor = floor
        self._colours = {link: c for p, c in shades.items() for link in _matching(robot, "colours", (p,))}
        self._meshes = [(link, simplified(m, detail)) for link, m in link_meshes(robot) if link not in unseen]
        self._dark = {int(robot.model.frames[frame].parentJoint) for frame in frames} - {0}
        self._stands: list[list[pin.SE3]] = [[] for _ in self._meshes]
        self._solid: list[render.ColouredMesh] = []
        self._pale: list[list[render.ColouredMesh]] = []
        self._key: list[tuple[Colour, str]] = []

    def add_robot(self, q: Array, pale: bool = False, pieces: Sequence[tuple[Solid, pin.SE3, Colour]] = ()) -> None:
        """The robot at a configuration.

        Args:
            pale: at another time, without links that stand where they stood before.
            pieces: what is drawn with it, (shape, pose in the world, colour).
        """
        model, data = self._robot.model, self._robot.model.createData()
        pin.framesForwardKinematics(model, data, self._robot.configuration("q", q))
        pale = validation.flag("Scene.pale", pale)
        extra = [_piece(piece) for piece in validation.items("Scene.pieces", pieces, "(shape, pose, colour)")]
        meshes = []
        for (link, triangles), stands in zip(self._meshes, self._stands, strict=True):
            index = model.getFrameId(link)
            pose = data.oMf[index].copy()
            if pale and any(pose.isApprox(other, SAME) for other in stands):
                continue
            stands.append(pose)
            plain = DARK if int(model.frames[index].parentJoint) in self._dark else WHITE
            colour = self._colours.get(link, plain)
            meshes.append(render.ColouredMesh(triangles @ pose.rotation.T + pose.translation, colour))
        meshes += extra
        if pale:
            self._pale.append(meshes)
        else:
            self._solid += meshes

    def add_shape(
        self,
        shape: Solid | Sequence[Convex],
        pose: pin.SE3,
        label: str = "",
        colour: Colour = OBSTACLE,
        pale: bool = False,
    ) -> None:
        """A shape of :mod:`wbc.shapes`, or the parts of a mesh, at a pose in the world; a label goes into the key."""
        place, colour = validation.pose("Scene.pose", pose), _colour(colour)
        meshes = [_surface(part, place, colour) for part in (shape if isinstance(shape, Sequence) else [shape])]
        if pale:
            self._pale.append(meshes)
        else:
            self._solid += meshes
        self._label(colour, label)

    def add_triangles(self, triangles: Array, label: str = "", colour: Colour = OBSTACLE) -> None:
        """Triangles in the world, m x 3 x 3 [m]."""
        colour = _colour(colour)
        corners = validation.ordinary_array("Scene.triangles", triangles)
        if corners.ndim != 3 or corners.shape[1:] != (3, 3):
            raise ShapeError("Scene.triangles", triangles, f"expected m x 3 x 3, not {corners.shape}")
        self._solid.append(render.ColouredMesh(corners, colour))
        self._label(colour, label)

    def add_path(self, points: Array, label: str = "", colour: Colour = PATH, radius: float = 0.006) -> None:
        """A tube along points, n x 3 [m]."""
        colour = _colour(colour)
        line = validation.ordinary_array("Scene.points", points)
        if line.ndim != 2 or line.shape[1] != 3:
            raise ShapeError("Scene.points", points, f"expected n x 3, not {line.shape}")
        wide = validation.scalar("Scene.radius", radius, low=0.0, open_low=True, unit="m")
        if float(np.linalg.norm(np.diff(line, axis=0), axis=1).sum()) > STATIONS * wide:
            raise RangeError("Scene.points", points, f"expected a path of at most {STATIONS} times its radius")
        self._solid.append(render.tube(line, wide, colour))
        self._label(colour, label)

    def save(
        self,
        file: str | pathlib.Path,
        size: tuple[int, int] = (960, 600),
        azimuth: float = math.radians(16.0),
        elevation: float = math.radians(24.0),
        around: Array | None = None,
    ) -> pathlib.Path:
        """Draw it into a PNG file, whose folder is made where it is not there; returns the file.

        Args:
            size: width and height [pixels].
            azimuth: side that it is seen from: 0 is +x, pi/2 is +y [rad].
            elevation: height that it is seen from: 0 is level, 1.5 nearly from above, which is the most [rad].
            around: points that fill the picture, n x 3 [m]; default: everything.
        """
        azimuth = validation.scalar("Scene.azimuth", azimuth, unit="rad")
        elevation = validation.scalar("Scene.elevation", elevation, low=-HIGHEST, high=HIGHEST, unit="rad")
        sides = [validation.integer("Scene.size", n, 1, PIXELS) for n in validation.items("Scene.size", size, "pixels")]
        if len(sides) != 2:
            raise RangeError("Scene.size", size, "expected two whole numbers of pixels above 0")
        if sides[0] * sides[1] > PIXELS:
            raise RangeError("Scene.size", size, f"expected at most {PIXELS} pixels in all")
        path = validation.file_path("Scene.file", file)
        if not any(len(mesh.triangles) for mesh in self._solid):
            raise RangeError("Scene", len(self._solid), "nothing was added that is not pale")
        fine = (SUPERSAMPLING * sides[0], SUPERSAMPLING * sides[1])
        shown = self.points() if around is None else validation.ordinary_array("Scene.around", around)
        if shown.ndim != 2 or shown.shape[1] != 3 or len(shown) < 2:
            raise ShapeError("Scene.around", around, f"expected two points or more, n x 3, not {shown.shape}")
        camera = render.framed(shown, fine, azimuth, elevation)
        image = _render(camera, self._solid, self._pale, self._floor)
        with validation.writing("Scene.file", path, RobotFileError, ValueError):
            path.parent.mkdir(parents=True, exist_ok=True)
            _write(image, self._key, path)
        return path

    def points(self) -> Array:
        """Some hundred points of each thing in it, enough to see how large it is, n x 3 [m]."""
        everything = [*self._solid, *(mesh for meshes in self._pale for mesh in meshes)]
        return np.concatenate([m.triangles.reshape(-1, 3)[:: max(1, len(m.triangles) // 200)] for m in everything])

    def film(self, camera: render.Camera) -> Callable[[], NDArray[np.uint8]]:
        """What was added so far stands still from now on, and is drawn once; without floor, shadows and key.

            frame = scene.film(camera)
            for q in motion:
                scene.add_robot(q)
                pictures.append(frame())

        Returns:
            A function that draws what was added since in front of it and behind it, takes it away again, and returns
            the picture, height x width x 3.

        Raises:
            ShapeError: no camera.
        """
        camera = validation.instance("Scene.camera", camera, render.Camera, "a Camera")
        camera = replace(camera, width=SUPERSAMPLING * camera.width, height=SUPERSAMPLING * camera.height)
        backdrop = render.Backdrop(self._taken(), camera)

        def frame() -> NDArray[np.uint8]:
            image = render.reduced(backdrop.over(self._taken()), SUPERSAMPLING)
            return np.asarray(255.0 * image + 0.5, dtype=np.uint8)

        return frame

    def _taken(self) -> list[render.ColouredMesh]:
        """What was added and is not pale, which then is no longer in the scene."""
        taken, self._solid = self._solid, []
        return taken

    def _label(self, colour: Colour, label: str) -> None:
        if label and (colour, label) not in self._key:
            self._key.append((colour, label))


#: Meshes of robots that were drawn, for as long as the robots live: to read them takes longer than to draw them
_READ: WeakKeyDictionary[Robot, list[tuple[str, Array]]] = WeakKeyDictionary()


def link_meshes(robot: Robot) -> list[tuple[str, Array]]:
    """(frame, triangles in it): the URDF's visual meshes, else the collision shapes. Not to be written to."""
    known = _READ.get(robot)
    if known is None:
        known = _READ[robot] = _link_meshes(robot)
        for _, triangles in known:
            triangles.setflags(write=False)
    return known


def _link_meshes(robot: Robot) -> list[tuple[str, Array]]:
    out = []
    for link, placement, geometry in bodies_of(robot, pin.GeometryType.VISUAL):
        if hasattr(geometry, "tri_indices"):  # a mesh of Coal
            vertices = np.array(geometry.vertices()) @ placement.rotation.T + placement.translation
            faces = [(t[0], t[1], t[2]) for t in (geometry.tri_indices(k) for k in range(geometry.num_tris))]
            out.append((link, vertices[np.array(faces, dtype=np.int64)]))
    if out:
        return out
    return [(link, render.triangles(placed)) for link, shapes in robot.shapes.items() for placed in shapes]


def _matching(robot: Robot, field: str, patterns: Sequence[str]) -> set[str]:
    found: set[str] = set()
    for pattern in validation.strings(f"Scene.{field}", patterns):
        names = fnmatch.filter(robot.frame_names, pattern)
        found.update(names or [robot.check_frame(f"Scene.{field}", pattern)])
    return found


def simplified(triangles: Array, detail: float) -> Array:
    """The corners in each cell of a grid of pitch ``detail`` [m] become one, in their middle; flat triangles go."""
    if detail <= 0.0:
        return triangles
    corners = triangles.reshape(-1, 3)
    cells = np.floor((corners - corners.min(axis=0)) / detail).astype(np.int64)
    # One number a cell: rows take numpy twenty times as long to sort
    across = cells.max(axis=0) + 1
    names, owner = np.unique((cells[:, 0] * across[1] + cells[:, 1]) * across[2] + cells[:, 2], return_inverse=True)
    sums = np.stack([np.bincount(owner, corners[:, k], len(names)) for k in range(3)], axis=1)
    middles = sums / np.bincount(owner, minlength=len(names))[:, None]
    faces = owner.reshape(-1, 3)
    kept = (faces[:, 0] != faces[:, 1]) & (faces[:, 1] != faces[:, 2]) & (faces[:, 2] != faces[:, 0])
    return np.asarray(middles[faces[kept]])


def _surface(shape: Solid, pose: pin.SE3, colour: Colour) -> render.ColouredMesh:
    if not isinstance(shape, Solid):
        raise ShapeError("Scene.shape", shape, "expected a shape", names_of_shapes())
    if isinstance(shape, Sphere):
        return render.sphere(np.array(pose.translation), shape.radius, colour)
    return render.ColouredMesh(render.triangles(PlacedShape(shape, pose)), colour)


def _render(
    camera: render.Camera, solid: list[render.ColouredMesh], pale: list[list[render.ColouredMesh]], floor: bool
) -> Array:
    points = _points(solid)
    shadows = render.Shadows(solid)
    base = min(0.0, float(points[:, 2].min()))
    image, depth = np.ones((camera.height, camera.width, 3)), np.full((camera.height, camera.width), np.inf)
    if floor:
        image, depth = render.floor(camera, shadows, base, points.mean(axis=0), 1.3)
    layer = render.draw(solid, camera)
    seen, colours = render.shade(layer, camera, shadows)
    image[seen] = colours
    depth = np.where(seen, layer.depth, depth)
    # What is behind everything, as the horizon, casts no dark on anything
    far = float(layer.depth[seen].max()) + 1.0
    for meshes in pale:
        tinted = [render.ColouredMesh(m.triangles, _tinted(m.colour)) for m in meshes]
        layer = render.draw(tinted, camera)
        seen, colours = render.shade(layer, camera, shadows)
        front = seen & (layer.depth < depth - BIAS)
        image[front] = (1.0 - GHOST) * image[front] + GHOST * colours[front[seen]]
    darker = render.occlusion(np.minimum(depth, far), 5.0 * SUPERSAMPLING)
    image *= (1.0 - np.where(image.min(axis=-1) < 0.99, darker, 0.0))[..., None]
    return render.reduced(image, SUPERSAMPLING)


def _piece(piece: Any) -> render.ColouredMesh:
    """(shape, pose, colour) as triangles."""
    three = validation.items("Scene.pieces", piece, "shape, pose and colour")
    if len(three) != 3:
        raise ShapeError("Scene.pieces", piece, "expected shape, pose and colour")
    return _surface(three[0], validation.pose("Scene.pose", three[1]), _colour(three[2]))


def _colour(colour: Any) -> Colour:
    """Red, green and blue from 0 to 1."""
    red, green, blue = validation.ordinary_array("Scene.colour", colour, (3,)).tolist()
    if not (min(red, green, blue) >= 0.0 and max(red, green, blue) <= 1.0):
        raise RangeError("Scene.colour", colour, "expected red, green and blue from 0 to 1")
    return red, green, blue


def _tinted(colour: Colour) -> Colour:
    """Links become blue; what has a colour of its own keeps it."""
    return TINT if colour in (WHITE, DARK) else colour


def _points(meshes: Sequence[render.ColouredMesh]) -> Array:
    return np.concatenate([m.triangles.reshape(-1, 3) for m in meshes])


def _write(image: Array, key: Sequence[tuple[Colour, str]], file: pathlib.Path) -> None:
    """The image, and in its upper right corner the colours and what they mean."""
    with style.pyplot() as plt:
        height, width = image.shape[:2]
        figure = plt.figure(figsize=(width / 100, height / 100), dpi=100)
        panel = figure.add_axes((0, 0, 1, 1))
        panel.imshow(np.clip(image, 0.0, 1.0), interpolation="none")
        panel.set_axis_off()
        for row, (colour, text) in enumerate(key):
            y = 34.0 + 28.0 * row
            panel.plot([width - 50.0, width - 22.0], [y, y], color=colour, lw=6.0)
            panel.text(width - 62.0, y, text, va="center", ha="right", fontsize=12, color=style.INK)
        figure.savefig(file, dpi=100)
        plt.close(figure)
