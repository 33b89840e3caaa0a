"""A walk as an animated picture: the structure is drawn once, the machine in every frame in front of or behind it."""

from __future__ import annotations

import pathlib
from collections.abc import Callable, Iterator

import numpy as np
from PIL import Image

from wbc.shapes import Capsule, Sphere
from wbc.track import render
from wbc.track.film import save_film
from wbc.validation import Array
from wbc.walking.log.log import WalkLog
from wbc.walking.report import surroundings
from wbc.walking.report.capsule_picture import Capsules, Ground
from wbc.walking.report.parts import PALE_HAND, Part, part_poses, parts_of
from wbc.walking.report.stills import AZIMUTH, ELEVATION, SHOWN, held_by
from wbc.walking.report.surroundings import arm_colour, mixed
from wbc.walking.run.recording import configuration
from wbc.walking.run.session import WalkRun

#: Without its suffix
FILE = "walk"
#: Width and height [pixels]
SIZE = (600, 400)
#: Pictures a second, how much faster than the walk they play, and how many there are at most
FRAMES_PER_SECOND, FASTER, MOST = 12, 2.0, 150
#: Vertical angle of view [rad], and the part of the picture that is filled
VIEW, FILLED = np.radians(18.0), 0.94
#: Colours of the picture, and radius of the ball that marks a hold that is held [m]
COLOURS, HELD = 160, 0.06


def save_animation(
    run: WalkRun,
    log: WalkLog,
    folder: pathlib.Path,
    size: tuple[int, int] | None = None,
    progress: Callable[[float], None] | None = None,
    stop: Callable[[], bool] | None = None,
) -> pathlib.Path | None:
    """Writes ``walk.mp4`` where an encoder is installed, else ``walk.gif``; None if ``stop`` ended it.

    Args:
        size: width and height [pixels]; default: :data:`SIZE`. progress: is told what part is done.
    """
    drawn: list[Image.Image] = []
    for part, image in pictures(run, log, size):
        if stop is not None and stop():
            return None
        drawn.append(image)
        if progress is not None:
            progress(part)
    return save_film(drawn, folder / FILE, FRAMES_PER_SECOND, COLOURS)


def pictures(
    run: WalkRun, log: WalkLog, size: tuple[int, int] | None = None, most: int | None = None
) -> Iterator[tuple[float, Image.Image]]:
    """Pictures of a film, each with the part of it that is done by then.

    Args:
        size: width and height [pixels]; default: :data:`SIZE`. most: pictures at most; default: :data:`MOST`.
    """
    turn = surroundings.upright(log).rotation
    rows = surroundings.near_rows(run.structure, log, SHOWN * surroundings.scale(run.walker))
    still = [
        render.ColouredMesh(surroundings.surface_triangles(run.structure, rows) @ turn.T, surroundings.SURFACE),
        render.ColouredMesh(surroundings.stud_triangles(run.structure, rows) @ turn.T, surroundings.HOLD),
        render.ColouredMesh(surroundings.obstacle_triangles(run.structure, rows) @ turn.T, surroundings.OBSTACLE),
    ]
    way = log.pose_body_in_structure[:, :3] @ turn.T
    camera = _camera(
        np.concatenate([*(m.triangles.reshape(-1, 3)[::7] for m in still), way, way + [0, 0, 0.25]]), size or SIZE
    )
    ground = Ground(camera, still)
    parts = [part for part in parts_of(run.walker) if isinstance(part.shape, Capsule | Sphere)]
    chosen = _rows(log, MOST if most is None else most)
    for number, row in enumerate(chosen):
        image = Image.fromarray(ground.over(_moving(run, log, int(row), parts, turn)))
        yield (number + 1) / len(chosen), image


def _rows(log: WalkLog, most: int) -> Array:
    """Rows of the log that become pictures, evenly over its time; the last is always there."""
    count = int(np.clip(log.t[-1] / FASTER * FRAMES_PER_SECOND, 2, most))
    return np.linspace(0, len(log) - 1, count).round().astype(int)


def _moving(run: WalkRun, log: WalkLog, row: int, parts: list[Part], turn: Array) -> Capsules:
    """The machine and the holds that it holds, in the picture's frame."""
    poses = part_poses(run.walker, parts, configuration(run.walker, log, row))
    half = [part.shape.length / 2 if isinstance(part.shape, Capsule) else 0.0 for part in parts]
    places, axes = (np.array([getattr(p, k) for p in poses]) for k in ("translation", "rotation"))
    core = np.array(half)[:, None] * axes[:, :, 2]
    held = held_by(log, row)
    studs = run.structure.positions[list(held)]
    radii = [part.shape.radius for part in parts if isinstance(part.shape, Capsule | Sphere)]
    colours = [part.colour for part in parts] + [mixed(arm_colour(arm), PALE_HAND) for arm in held.values()]
    return Capsules(
        np.concatenate([places - core, studs]) @ turn.T,
        np.concatenate([places + core, studs]) @ turn.T,
        np.array(radii + [HELD] * len(held)),
        np.array(colours),
    )


def _camera(points: Array, size: tuple[int, int]) -> render.Camera:
    """Looks so that the points fill the picture."""
    flat = np.cos(ELEVATION)
    direction = np.array([flat * np.cos(AZIMUTH), flat * np.sin(AZIMUTH), np.sin(ELEVATION)])
    target, distance = points.mean(axis=0), 8.0
    for _ in range(6):
        camera = render.Camera(target + distance * direction, target, VIEW, *size)
        screen = camera.project(points)[:, :2]
        low, high = screen.min(axis=0), screen.max(axis=0)
        off = (low + high) / 2 - np.array(size) / 2
        right, up, _ = camera.axes
        target = target + (off[0] * right - off[1] * up) * distance / camera.focal
        distance *= float(np.max((high - low) / (FILLED * np.array(size))))
    return render.Camera(target + distance * direction, target, VIEW, *size)
