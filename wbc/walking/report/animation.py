"""A walk as an animated picture: the structure is drawn once, the machine in every frame in front of or behind it."""

from __future__ import annotations

import pathlib
from collections.abc import Callable, Iterator

import numpy as np
from PIL import Image

from wbc.track import render
from wbc.track.film import save_film
from wbc.validation import Array
from wbc.walking.log.log import WalkLog
from wbc.walking.report import surroundings
from wbc.walking.report.stills import AZIMUTH, ELEVATION, add_held, add_machine, add_structure, held_by, new_scene
from wbc.walking.run.session import WalkRun

#: Without its suffix
FILE = "walk"
#: Width and height [pixels]
SIZE = (600, 400)
#: Pictures a second, how much faster than the walk they play, and how many there are at most
FRAMES_PER_SECOND, FASTER, MOST = 12, 2.0, 150
#: Vertical angle of view [rad], and the part of the picture that is filled
VIEW, FILLED = np.radians(18.0), 0.94
#: Height above the way of the body that has to be in the picture [m]
ABOVE = 0.25
#: Corners of meshes closer than this are drawn as one [m]
DETAIL = 0.012
#: Colours of the picture
COLOURS = 160


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
    scene = new_scene(run, DETAIL)
    add_structure(scene, run, log, {})
    way = log.pose_body_in_structure[:, :3] @ surroundings.upright(log).rotation.T
    scene.add_path(way)
    around = np.concatenate([scene.points(), way + [0.0, 0.0, ABOVE]])
    frame = scene.film(render.framed(around, size or SIZE, AZIMUTH, ELEVATION, VIEW, FILLED))
    chosen = _rows(log, MOST if most is None else most)
    for number, row in enumerate(chosen):
        add_machine(scene, run, log, int(row))
        add_held(scene, run, log, held_by(log, int(row)))
        yield (number + 1) / len(chosen), Image.fromarray(frame())


def _rows(log: WalkLog, most: int) -> Array:
    """Rows of the log that become pictures, evenly over its time; the last is always there."""
    count = int(np.clip(log.t[-1] / FASTER * FRAMES_PER_SECOND, 2, most))
    return np.linspace(0, len(log) - 1, count).round().astype(int)
