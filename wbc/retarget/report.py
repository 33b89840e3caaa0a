"""What a retargeted clip leaves in its folder: the motion, figures, a film and a page."""

from __future__ import annotations

import json
import pathlib
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw

from wbc import extras
from wbc.multibody import pin
from wbc.retarget.clip import Array
from wbc.retarget.outputs.writing import MOTION_FORMATS, write_motion
from wbc.shapes import Box
from wbc.track import render
from wbc.track.film import save_film
from wbc.track.page import RunPage
from wbc.track.scene import Colour, Scene

if TYPE_CHECKING:
    from wbc.retarget.retargeted import Retargeted

#: Colours of the robot, of the person beside it, and of the ground
ROBOT: Colour = (0.32, 0.42, 0.58)
PERSON: Colour = (0.93, 0.55, 0.15)
GROUND: Colour = (0.80, 0.78, 0.73)
#: Radius of a bone as drawn [m]
BONE = 0.018
#: Size of a film [pixels]
FILM_SIZE = (560, 330)
#: Pictures a second of a film [Hz]
FILM_RATE = 10.0
#: Pictures of a film, at most
MOST_PICTURES = 120
#: Side that a film is seen from [rad]
AZIMUTH = -1.0
#: Height that it is seen from [rad]
ELEVATION = 0.25
#: The person stands so far beside the robot, in heights of the robot
ASIDE = 0.8
#: Links reach so far beyond the joints [m]
LINK = 0.2
#: The ground is drawn so far beyond the motion [m]
BEYOND = 0.7
#: Corners of meshes closer than this are drawn as one [m]
DETAIL = 0.02


def write_report(
    motion: Retargeted,
    folder: pathlib.Path,
    formats: Sequence[str] = (),
    *,
    seconds: float | None = None,
    film: bool = True,
    support: bool = False,
) -> dict[str, Any]:
    """Write a clip's folder, which is there; returns the figures that ``report.json`` holds.

    Args:
        formats: more formats of the motion, keys of :data:`~wbc.retarget.outputs.MOTION_FORMATS`.
        seconds: time that retargeting took, with the making of its stack where that is new [s].
        film: whether a film is drawn, and put on the page. support: whether :func:`~wbc.retarget.held` looks for forces
            of contacts and torques of motors that hold the robot at rest; not for a robot whose base is fixed.

    Raises:
        UnknownNameError: no such format. ClipFileError: a file cannot be written.
    """
    write_motion(motion, folder / "motion.npz", "npz")
    for kind in formats:
        if kind != "npz":
            write_motion(motion, folder / f"motion-{kind}{MOTION_FORMATS.get(kind, '')}", kind)
    figures: dict[str, Any] = {"clip": motion.clip.name, "robot": motion.robot.name}
    figures |= motion.errors.figures
    if seconds is not None:
        figures |= {"seconds": seconds, "frames_a_second": len(motion.q) / max(seconds, 1e-9)}
    far = motion.errors.points
    figures["error"] = motion.errors.mean
    figures["errors"] = {name: {"mean": float(d.mean()), "largest": float(d.max())} for name, d in far.items()}
    if support and motion.robot.base != "fixed":
        from wbc.retarget.holding_forces import held

        at_rest = held(motion)
        figures |= {"held_at_rest": at_rest.share, "support": str(at_rest)}
    figures["given_up"] = [str(entry) for entry in motion.given_up]
    figures["notes"] = list(motion.notes)
    lines = text_lines(figures)
    (folder / "report.txt").write_text("\n".join([*lines, ""]), encoding="utf-8")
    page = RunPage(f"{motion.clip.name} on {motion.robot.name}", f"{len(motion.q)} frames at {motion.rate:g} Hz")
    if film:
        extras.require("plots", "a film", "matplotlib")
        page.picture(save_motion_film(motion, folder / "film.mp4"), "robot, and the person beside it")
    page.verbatim("\n".join(lines))
    page.save(folder)
    # Last: who goes on with a folder of clips takes a clip with this file as done
    (folder / "report.json").write_text(json.dumps(figures, indent=1) + "\n", encoding="utf-8")
    return figures


def text_lines(figures: Mapping[str, Any]) -> list[str]:
    """The figures as lines of a report."""
    lines = [f"{figures['clip']} on {figures['robot']}: {figures['frames']} frames at {figures['rate']:g} Hz"]
    if "frames_a_second" in figures:
        lines.append(f"retargeted in {figures['seconds']:.3g} s: {figures['frames_a_second']:.4g} frames a second")
    lines.append(f"slide in stance: {1e3 * figures['slide']:.3g} mm at most")
    lines += [f"  {foot}: {1e3 * slide:.3g} mm" for foot, slide in figures["slides"].items()]
    if "penetration" in figures:
        frames = figures["penetration_frames"]
        lines.append(f"below the ground: {1e3 * figures['penetration']:.3g} mm at most, {frames} frames beyond 1 mm")
    for what, share in (("position", ""), ("velocity", "fastest"), ("acceleration", "quickest")):
        most = f", at most {figures[share]:.3g} of the limit" if share else ""
        lines.append(f"{what} limits: {figures[f'{what}_breaches']} frames beyond them{most}")
    lines.append(f"jumps: {figures['jumps']}")
    lines.append(f"key points from their targets: {1e3 * figures['error']:.3g} mm in the mean")
    for name, far in figures["errors"].items():
        lines.append(f"  {name}: {1e3 * far['mean']:.3g} mm, {1e3 * far['largest']:.3g} mm at most")
    lines += [figures["support"]] if "support" in figures else []
    lines += [f"gave way: {entry}" for entry in figures["given_up"]] or ["gave way: nothing"]
    return lines + [f"note: {note}" for note in figures["notes"]]


def save_motion_film(motion: Retargeted, file: pathlib.Path) -> pathlib.Path:
    """A film of the robot and, beside it, the person's skeleton; the camera stands still. Returns the file."""
    q = motion.q
    count = int(np.clip(motion.time[-1] * FILM_RATE, 2, MOST_PICTURES))
    rows = np.unique(np.linspace(0, len(q) - 1, count).astype(int))
    extent, size = _extent(motion, rows)
    points, bones = _beside(motion, rows, extent)
    everything = np.concatenate([points.reshape(-1, 3), extent])
    low, high = everything.min(axis=0) - BEYOND * size, everything.max(axis=0) + BEYOND * size
    scene = Scene(motion.robot, colours={"*": ROBOT}, floor=False, detail=DETAIL * size)
    ground = min(0.0, float(everything[:, 2].min())) - 0.01
    middle = pin.SE3(np.eye(3), np.array([*(0.5 * (low + high))[:2], ground]))
    scene.add_shape(Box((*(high - low)[:2].tolist(), 0.02)), middle, "ground", GROUND)
    shot = scene.film(render.framed(everything, FILM_SIZE, AZIMUTH, ELEVATION, filled=0.9))
    frames = []
    for k, row in enumerate(rows):
        scene.add_robot(q[row])
        for line in points[k][bones]:
            if np.linalg.norm(line[1] - line[0]) > BONE * size:
                scene.add_path(line, colour=PERSON, radius=BONE * size)
        image = Image.fromarray(shot())
        standing = ", ".join(limb for limb, stands in motion.stance.items() if stands[row])
        words = f"{motion.clip.name}  {motion.time[row]:6.2f} s   stands: {standing or 'nothing'}"
        ImageDraw.Draw(image).text((8, 8), words, fill=(34, 39, 46))
        frames.append(image)
    return save_film(frames, file, len(rows) / max(float(motion.time[-1]), 1e-9))


def _beside(motion: Retargeted, rows: NDArray[np.int_], extent: Array) -> tuple[Array, list[tuple[int, int]]]:
    """The person's points in the film's frames, scaled to the robot's height and moved aside, and its bones."""
    clip, parents = motion.clip, motion.clip.skeleton.parents
    points = clip.points[np.clip(np.round(motion.time[rows] * clip.rate).astype(int), 0, len(clip.points) - 1)]
    tall, height = float(np.ptp(clip.points[:, :, 2], axis=1).max()), float(np.ptp(extent[:, 2])) or 1.0
    points = points * (height / max(tall, 1e-6))
    aside = extent.mean(axis=0) - points.mean(axis=(0, 1))
    aside[1] += 0.5 * float(np.ptp(points[:, :, 1]) + np.ptp(extent[:, 1])) + ASIDE * height
    points = points + np.array([*aside[:2], 0.0 if motion.robot.base != "fixed" else aside[2]])
    if max(parents) >= 0:
        return points, [(parent, joint) for joint, parent in enumerate(parents) if parent >= 0]
    # Markers without bones: each with the nearest one
    middle = clip.points[len(clip.points) // 2]
    apart = np.linalg.norm(middle[:, None] - middle[None], axis=2) + 1e3 * np.eye(len(middle))
    return points, [(joint, int(other)) for joint, other in enumerate(apart.argmin(axis=1))]


def _extent(motion: Retargeted, rows: NDArray[np.int_]) -> tuple[Array, float]:
    """Places of joints in some frames and what links reach beyond them [n, 3], and the robot's size, up to 1 [m]."""
    model, data, out = motion.robot.model, motion.robot.model.createData(), []
    for row in rows[:: max(1, len(rows) // 40)]:
        pin.forwardKinematics(model, data, motion.q[row])
        out += [data.oMi[joint].translation.copy() for joint in range(1, model.njoints)]
    places = np.array(out)
    size = min(1.0, float(np.linalg.norm(np.ptp(places, axis=0))) or 1.0)
    return np.concatenate([places, places.max(axis=0, keepdims=True) + LINK * size]), size
