"""What a retargeted clip leaves in its folder: the motion, figures, a film and a page."""

from __future__ import annotations

import json
import pathlib
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from PIL import Image, ImageDraw

from wbc import extras
from wbc.multibody import pin
from wbc.retarget.outputs import write_motion
from wbc.retarget.poses import frame_poses
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
#: Size of a film [pixels]
FILM_SIZE = (560, 330)
#: Pictures a second of a film [Hz]
FILM_RATE = 10.0
#: Pictures of a film, at most
MOST_PICTURES = 120
#: The person stands so far beside the robot, in heights of the robot
ASIDE = 0.8
#: Radius of a bone as drawn, in sizes of the motion
BONE = 0.018


def write_report(
    motion: Retargeted,
    folder: pathlib.Path,
    formats: Sequence[str] = (),
    *,
    seconds: float | None = None,
    film: bool = True,
    more: Mapping[str, Any] | None = None,
) -> dict[str, Any]:
    """Write a clip's folder, which is there; returns the figures that ``report.json`` holds.

    Args:
        formats: more formats of the motion, keys of :data:`~wbc.retarget.outputs.MOTION_FORMATS`.
        seconds: time that retargeting took, with the making of its stack where that is new [s].
        film: whether a film is drawn, and put on the page. more: plain data that the figures hold, too.

    Raises:
        UnknownNameError: no such format. ClipFileError: a file cannot be written.
    """
    write_motion(motion, folder / "motion")
    for kind in formats:
        if kind != "npz":
            write_motion(motion, folder / f"motion-{kind}", kind)
    figures: dict[str, Any] = {"clip": motion.clip.name, "robot": motion.robot.name} | motion.errors.figures
    figures |= more or {}
    title, lead = f"{figures['clip']} on {figures['robot']}", f"{len(motion.q)} frames at {motion.rate:g} Hz"
    lines = [f"{title}: {lead}", *str(motion.errors).splitlines()]
    if seconds is not None:
        figures |= {"seconds": seconds, "frames_a_second": len(motion.q) / max(seconds, 1e-9)}
        lines.insert(1, f"retargeted in {seconds:.3g} s: {figures['frames_a_second']:.4g} frames a second")
    if "support" in figures:
        lines.append(figures["support"])
    figures |= {"given_up": [str(entry) for entry in motion.given_up], "notes": list(motion.notes)}
    lines += [f"gave way: {entry}" for entry in figures["given_up"] or ["nothing"]]
    text = "\n".join([*lines, *(f"note: {note}" for note in motion.notes)])
    (folder / "report.txt").write_text(f"{text}\n", encoding="utf-8")
    page = RunPage(title, lead)
    if film:
        extras.require("plots", "a film", "matplotlib")
        page.picture(save_motion_film(motion, folder / "film.mp4"), "robot, and the person beside it")
    page.verbatim(text)
    page.save(folder)
    # Last: who goes on with a folder of clips takes a clip with this file as done
    (folder / "report.json").write_text(json.dumps(figures, indent=1) + "\n", encoding="utf-8")
    return figures


def save_motion_film(motion: Retargeted, file: pathlib.Path) -> pathlib.Path:
    """A film of the robot and, beside it, the person's skeleton; the camera stands still. Returns the file."""
    robot, clip = motion.robot, motion.clip
    count = int(np.clip(motion.time[-1] * FILM_RATE, 2, MOST_PICTURES))
    rows = np.unique(np.linspace(0, len(motion.q) - 1, count).astype(int))
    frames = tuple(frame for frame in robot.frame_names if frame.startswith("retarget_"))
    extent = frame_poses(robot, frames, motion.q[rows])[1].reshape(-1, 3)
    # The person, as tall as the robot, beside it
    points = clip.points[np.clip(np.round(motion.time[rows] * clip.rate).astype(int), 0, len(clip.points) - 1)]
    height = float(np.ptp(extent[:, 2])) or 1.0
    points = points * (height / max(float(np.ptp(points[:, :, 2], axis=1).max()), 1e-6))
    aside = extent.mean(axis=0) - points.mean(axis=(0, 1))
    aside[1] += 0.5 * float(np.ptp(points[:, :, 1]) + np.ptp(extent[:, 1])) + ASIDE * height
    points = points + aside * np.array([1.0, 1.0, robot.base == "fixed"])
    bones = [(parent, joint) for joint, parent in enumerate(clip.skeleton.parents) if parent >= 0]
    everything = np.concatenate([points.reshape(-1, 3), extent])
    low, high = everything.min(axis=0), everything.max(axis=0)
    size = min(1.0, float(np.linalg.norm(np.ptp(extent, axis=0))) or 1.0)
    scene = Scene(robot, colours={"*": ROBOT}, floor=False, detail=0.02 * size)
    ground = pin.SE3(np.eye(3), np.array([*(0.5 * (low + high))[:2], min(0.0, float(low[2])) - 0.01]))
    scene.add_shape(Box((*(high - low + 1.8 * size)[:2].tolist(), 0.02)), ground, "ground", GROUND)
    shot, pictures = scene.film(render.framed(everything, FILM_SIZE, azimuth=-1.0, elevation=0.25, filled=0.8)), []
    for row, places in zip(rows, points, strict=True):
        scene.add_robot(motion.q[row])
        for line in places[bones]:
            if np.linalg.norm(line[1] - line[0]) > BONE * size:
                scene.add_path(line, colour=PERSON, radius=BONE * size)
        pictures.append(image := Image.fromarray(shot()))
        standing = ", ".join(limb for limb, stands in motion.stance.items() if stands[row])
        words = f"{clip.name}  {motion.time[row]:6.2f} s   stands: {standing or 'nothing'}"
        ImageDraw.Draw(image).text((8, 8), words, fill=(34, 39, 46))
    return save_film(pictures, file, len(rows) / max(float(motion.time[-1]), 1e-9))
