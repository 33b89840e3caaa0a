"""Pictures of a climb: the whole way in one, instants of it, and a film."""

from __future__ import annotations

import pathlib
from collections.abc import Callable, Iterator

import numpy as np
from PIL import Image, ImageDraw

from wbc.climb.loop import ClimbRun
from wbc.climb.report import surroundings
from wbc.climb.report.surroundings import SHOWN, STUD, limb_colour, mixed
from wbc.climb.scene import size_of
from wbc.climb.stance import FREE_LIMB
from wbc.multibody import pin
from wbc.track import film, render
from wbc.track.scene import Scene

#: The whole climb in one picture
OVERVIEW = "climb.png"
#: Instants of it
STILLS = 3
#: Width and height of pictures [pixels]
PICTURE_SIZE = (960, 640)
#: Width and height of a film [pixels]
FILM_SIZE = (640, 420)
#: Pictures of a film a second [Hz]
FRAMES = 12.0
#: How much faster than the climb a film plays [1]
FASTER = 2.0
#: Pictures of a film, at most
MOST_FRAMES = 150
#: Corners of meshes closer than this share of a limb's reach are drawn as one in a film
DETAIL = 0.006
#: Side that a climb is seen from, 0 being ahead [rad]
AZIMUTH = -1.01
#: Side of the light of pictures [rad]
LIT = float(np.arctan2(render.LIGHT[1], render.LIGHT[0]))
#: By which a wall is seen from beside its normal [rad]
ASIDE = 0.5
#: Height that walls are seen from [rad]
ELEVATION_OF_WALLS = 0.3
#: Height that it is seen from [rad]
ELEVATION = 0.52
#: Horizontal part of the footholds' mean normal from which they are on a wall [1]
WALL = 0.5
#: A way that is shorter than this has no direction [m]
SHORT_WAY = 0.02
#: Footholds that are held are drawn so much larger [1]
HELD_STUD = 1.6
#: White in the colour of one that a limb holds
HELD_WHITE = 0.1
#: Vertical angle of view of a film [rad]
VIEW = 0.31
#: Share of a film's picture that is filled
FILLED = 0.94


class ClimbPictures:
    """What is drawn of a climb. Up is against gravity, or out of the footholds that are held; x is where the body goes.

    Args:
        run: what was done. detail: corners of meshes closer than this are drawn as one [m].

    Attributes:
        climber, scene: of the run. t: its times [s]. near: rows of footholds near the way. stud: their radius [m].
        turn: from the world to the picture ``(3, 3)``. azimuth, elevation: side and height that it is seen from [rad].
        around: points that fill a picture ``(n, 3)`` [m]. on_wall: whether footholds are on a wall.
    """

    def __init__(self, run: ClimbRun, detail: float = 0.0) -> None:
        self.climber, self.scene, self._detail = run.plans[0].climber, run.scene, detail
        self.t, self._q = run.log["t"], run.log.array("q")
        self._contacts = run.log.array("contact").astype(int)
        self._reach = size_of(self.climber)
        self.stud = STUD * self._reach
        held = [row for row in np.unique(self._contacts).tolist() if row != FREE_LIMB]
        way = self._q[:, :3]
        up, normal = surroundings.upwards(self.scene, held), self.scene.normals[held].mean(axis=0)
        ahead, level = way[-1] - way[0], normal - (normal @ up) * up
        self.on_wall = float(np.linalg.norm(level)) > WALL
        if self.on_wall:
            # The wall is lit where its normal has the side of the light
            level = level / np.linalg.norm(level)
            ahead = np.cos(LIT) * level - np.sin(LIT) * np.cross(up, level)
        elif float(np.linalg.norm(ahead - (ahead @ up) * up)) < SHORT_WAY:
            ahead = self.climber.body_pose(self._q[0]).rotation @ np.array([1.0, 0.0, 0.0])
        x = ahead - (ahead @ up) * up
        x = x / np.linalg.norm(x) if np.linalg.norm(x) > 1e-6 else np.linalg.svd(up[None])[2][1]
        self.turn = np.stack([x, np.cross(up, x), up])
        self.azimuth, self.elevation = (LIT + ASIDE, ELEVATION_OF_WALLS) if self.on_wall else (AZIMUTH, ELEVATION)
        self.near = surroundings.near_footholds(self.scene, way, SHOWN * self._reach)
        self._way = way @ self.turn.T
        normal = self.turn @ normal / np.linalg.norm(normal)
        above = self._way + 0.2 * self._reach * normal
        # Limbs at both ends of the way, stretched along the surface
        axes = np.vstack([np.eye(3), -np.eye(3)])
        spread = SHOWN * self._reach * (axes - np.outer(axes @ normal, normal))
        ends = [self._way[row] + spread for row in (0, -1)]
        self.around = np.concatenate([self.scene.positions[self.near] @ self.turn.T, above, *ends])

    def begin(self, held: dict[int, int], bodies_only: bool = False) -> Scene:
        """A picture with the surroundings.

        Args:
            held: row of a foothold that a limb holds -> the limb. bodies_only: leaves out the footholds.
        """
        scene = Scene(
            self.climber.robot, detail=self._detail, colours=surroundings.link_colours(self.climber), floor=False
        )
        reach, way = self._reach, self._q[:, :3]
        surface = surroundings.surface_triangles(self.scene, self.near, reach)
        bodies = surroundings.body_triangles(self.scene, way, SHOWN * reach, self.near.tolist())
        plain = [] if bodies_only else [row for row in self.near.tolist() if row not in held]
        studs = surroundings.stud_triangles(self.scene, plain, self.stud)
        for triangles, colour in (
            (surface, surroundings.SURFACE),
            (bodies, surroundings.BODY),
            (studs, surroundings.FREE),
        ):
            if len(triangles):
                scene.add_triangles(triangles @ self.turn.T, colour=colour)
        self.add_held(scene, held)
        return scene

    def add_held(self, scene: Scene, held: dict[int, int]) -> None:
        """Footholds that are held, in the colours of their limbs."""
        for row, limb in held.items():
            stud = surroundings.stud_triangles(self.scene, [row], HELD_STUD * self.stud)
            scene.add_triangles(stud @ self.turn.T, colour=mixed(limb_colour(limb), HELD_WHITE))

    def add_robot(self, scene: Scene, row: int, pale: bool = False) -> None:
        """The robot at a tick."""
        pose = pin.SE3(self.turn, np.zeros(3)) * self.climber.body_pose(self._q[row])
        scene.add_robot(self.climber.with_body(self._q[row], pose), pale)

    def held_at(self, row: int) -> dict[int, int]:
        """Row of a foothold -> the limb that holds it at a tick."""
        return {at: limb for limb, at in enumerate(self._contacts[row].tolist()) if at != FREE_LIMB}

    def swings(self) -> list[int]:
        """Ticks in the middle of times in which a limb is in the air; where there are none the first and the last."""
        aloft = (self._contacts == FREE_LIMB).any(axis=1)
        edges = np.flatnonzero(np.diff(np.concatenate([[False], aloft, [False]])))
        return ((edges[::2] + edges[1::2]) // 2).tolist() or [0, len(aloft) - 1]

    def overview(self, file: pathlib.Path) -> pathlib.Path:
        """The robot in the middle of the climb, pale where it began and ended, and the way of its body."""
        swings = self.swings()
        middle = swings[len(swings) // 2]
        scene = self.begin(self.held_at(middle))
        self.add_robot(scene, middle)
        for row in (0, len(self._q) - 1):
            self.add_robot(scene, row, pale=True)
        self.add_way(scene)
        return scene.save(file, PICTURE_SIZE, self.azimuth, self.elevation, self.around)

    def still(self, row: int, file: pathlib.Path) -> list[pathlib.Path]:
        """The robot at a tick, as the only file."""
        scene = self.begin(self.held_at(row))
        self.add_robot(scene, row)
        return [scene.save(file, PICTURE_SIZE, self.azimuth, self.elevation, self.around)]

    def frames(self, size: tuple[int, int] = FILM_SIZE, most: int = MOST_FRAMES) -> Iterator[tuple[float, Image.Image]]:
        """Pictures of a film, evenly over the climb, each with the share of the film that is done by then."""
        scene = self.begin({})
        self.add_way(scene)
        shot = scene.film(render.framed(self.around, size, self.azimuth, self.elevation, VIEW, FILLED))
        count = int(np.clip(self.t[-1] / FASTER * FRAMES, 2, most))
        for number, row in enumerate(np.linspace(0, len(self._q) - 1, count).round().astype(int).tolist()):
            self.add_robot(scene, row)
            self.add_held(scene, self.held_at(row))
            image = Image.fromarray(shot())
            ImageDraw.Draw(image).text((8, 8), f"{self.t[row]:6.2f} s", fill=(34, 39, 46))
            yield (number + 1) / count, image

    def add_way(self, scene: Scene) -> None:
        """The way of the body."""
        thin = self._way[:: max(1, len(self._way) // 300)]
        if float(np.linalg.norm(np.ptp(thin, axis=0))) > SHORT_WAY:
            scene.add_path(thin, "path of the body", radius=0.004 * self._reach)


def save_film(
    run: ClimbRun,
    file: pathlib.Path,
    progress: Callable[[float], None] | None = None,
    stop: Callable[[], bool] | None = None,
) -> list[pathlib.Path]:
    """An MP4 where an encoder is installed, else a GIF, as the only file; none where ``stop`` ended it."""
    drawn, pictures = list[Image.Image](), ClimbPictures(run, DETAIL * size_of(run.plans[0].climber))
    for share, image in pictures.frames():
        if stop is not None and stop():
            return []
        drawn.append(image)
        if progress is not None:
            progress(share)
    return [film.save_film(drawn, file, FRAMES)]
