"""What a climb leaves: its log, the check, figures, a picture and a film."""

from __future__ import annotations

import json
import pathlib
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from PIL import Image, ImageDraw

import wbc.log
from wbc.clearance import CylinderInside, EndlessCylinder, TriangleMesh
from wbc.climb.checker import ClimbReport
from wbc.climb.loop import ClimbRun
from wbc.climb.loop.limb_state import LimbState
from wbc.multibody import pin
from wbc.shapes import Box, Cylinder, HalfSpace, Solid, Sphere
from wbc.track import render
from wbc.track.film import save_film
from wbc.track.scene import Colour, Scene
from wbc.validation import Array

#: Files of a run's folder
WRITTEN = ("log.npz", "check.txt", "figures.json", "climb.png", "climb.mp4", "climb.gif")
#: Colour of links
LINK: Colour = (0.32, 0.42, 0.58)
#: Colour of bodies
GROUND: Colour = (0.80, 0.78, 0.73)
#: Colour of footholds that are not held
FREE: Colour = (0.62, 0.62, 0.62)
#: Colour of footholds that are
USED: Colour = (0.93, 0.55, 0.15)
#: Size of a film [pixels]
FILM_SIZE = (640, 420)
#: Size of a picture [pixels]
PICTURE_SIZE = (1200, 760)
#: Pictures a second of a film [Hz]
FRAMES = 12.0
#: Pictures of a film at most
MOST_FRAMES = 200
#: Side that a climb on level ground is seen from [rad]
AZIMUTH = -1.1
#: By which one on a wall is seen from beside its normal [rad]
ASIDE = 0.6
#: Height that it is seen from [rad]
ELEVATION = 0.5
#: Radius of a foothold as drawn, as a share of the footholds' extent
DOT = 0.008
#: The same at most [m]
LARGEST_DOT = 0.02
#: How far bodies without end are drawn beyond the footholds [m]
BEYOND = 0.5


def write(
    run: ClimbRun, report: ClimbReport | None, about: Mapping[str, Any], folder: pathlib.Path, pictures: bool = True
) -> list[pathlib.Path]:
    """The files of a climb; returns them.

    Args:
        run: what was done. report: its check, None: there was none. about: more figures, plain data.
        folder: is there. pictures: whether picture and film are drawn.

    Raises:
        LogFileError: the log cannot be written.
    """
    written = [wbc.log.save(run.log, folder, "npz")]
    if report is not None:
        written.append(folder / "check.txt")
        written[-1].write_text(f"{report}\n", encoding="utf-8")
    figures = {
        "outcome": str(run.outcome), "reason": run.reason, "duration": float(run.log["t"][-1]),
        "steps": sum(state is LimbState.LATCHING for *_, state, _ in run.changes), "plans": len(run.plans),
        "violations": None if report is None else [str(finding) for finding in report.violations], **about,
    }  # fmt: skip
    written.append(folder / "figures.json")
    written[-1].write_text(json.dumps(figures, indent=1), encoding="utf-8")
    if pictures:
        written += [picture(run, folder / "climb.png"), film(run, folder / "climb.mp4")]
    return written


def picture(run: ClimbRun, file: pathlib.Path) -> pathlib.Path:
    """The robot at the end, and pale at the start, with the way of its body."""
    scene, q = _around(run), run.log.array("q")
    scene.add_robot(q[0], pale=True)
    scene.add_robot(q[-1])
    scene.add_path(q[:: max(1, len(q) // 200), :3], radius=0.004)
    Image.fromarray(scene.film(_camera(run, PICTURE_SIZE))()).save(file)
    return file


def film(run: ClimbRun, file: pathlib.Path, progress: Callable[[float], None] | None = None) -> pathlib.Path:
    """An MP4 where an encoder is installed, else a GIF; the camera stands still."""
    scene, q, t = _around(run), run.log.array("q"), run.log["t"]
    shot = scene.film(_camera(run, FILM_SIZE))
    end = float(t[-1])
    times, frames = np.linspace(0.0, end, int(np.clip(end * FRAMES, 2, MOST_FRAMES))), []
    for k, time in enumerate(times):
        row = min(int(np.searchsorted(t, time)), len(t) - 1)
        scene.add_robot(q[row])
        image = Image.fromarray(shot())
        held = [limb for limb, column in run.log.group("contact").items() if column[row] >= 0]
        words = f"{t[row]:6.2f} s   holds: {', '.join(held)}"
        ImageDraw.Draw(image).text((8, 8), words, fill=(34, 39, 46))
        frames.append(image)
        if progress is not None:
            progress((k + 1) / len(times))
    return save_film(frames, file, min(FRAMES, len(times) / max(end, 1e-9)))


def _camera(run: ClimbRun, size: tuple[int, int]) -> render.Camera:
    """Sees footholds that are held and the way of the body; from in front of walls."""
    places = run.plans[-1].scene.footholds
    held = [row for row in np.unique(run.log.array("contact").astype(int)).tolist() if row >= 0]
    x, y, _ = np.mean([places[row].pose.rotation[:, 2] for row in held], axis=0)
    azimuth = np.arctan2(y, x) + ASIDE if np.hypot(x, y) > 0.5 else AZIMUTH
    seen = np.vstack([[places[row].pose.translation for row in held], run.log.array("q")[:, :3]])
    return render.framed(seen, size, float(azimuth), ELEVATION, filled=0.7)


def _around(run: ClimbRun) -> Scene:
    """Bodies and footholds."""
    plan = run.plans[-1]
    scene = Scene(plan.climber.robot, colours={"*": LINK}, floor=False)
    places = np.array([foothold.pose.translation for foothold in plan.scene.footholds])
    for body in plan.scene.bodies.values():
        _add(scene, body.shape, body.placement, places)
    used = {row for row in np.unique(run.log.array("contact").astype(int)).tolist() if row >= 0}
    radius = min(LARGEST_DOT, DOT * float(np.linalg.norm(np.ptp(places, axis=0))))
    for row, place in enumerate(places):
        there = pin.SE3(np.eye(3), place)
        scene.add_shape(Sphere(radius), there, "held" if row in used else "foothold", USED if row in used else FREE)
    return scene


def _add(scene: Scene, shape: Any, pose: pin.SE3, places: Array) -> None:
    """A body, of one without end the part at the footholds; the wall round a cylinder is not drawn."""
    local = (places - pose.translation) @ pose.rotation
    low, high = local.min(axis=0) - BEYOND, local.max(axis=0) + BEYOND
    middle = (low + high) / 2.0
    if isinstance(shape, HalfSpace):
        slab = pin.SE3(np.eye(3), np.array([middle[0], middle[1], -0.01]))
        scene.add_shape(Box((float(high[0] - low[0]), float(high[1] - low[1]), 0.02)), pose * slab, "body", GROUND)
    elif isinstance(shape, EndlessCylinder):
        piece = Cylinder(shape.radius, float(high[2] - low[2]))
        scene.add_shape(piece, pose * pin.SE3(np.eye(3), np.array([0.0, 0.0, middle[2]])), "body", GROUND)
    elif isinstance(shape, TriangleMesh):
        scene.add_triangles(shape.corners @ pose.rotation.T + pose.translation, "body", GROUND)
    elif isinstance(shape, Solid) and not isinstance(shape, CylinderInside):
        scene.add_shape(shape, pose, "body", GROUND)
