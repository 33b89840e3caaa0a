"""Plots and the film of trials on a moving object."""

from __future__ import annotations

import pathlib
from collections.abc import Callable, Mapping

import numpy as np
import pinocchio as pin
from PIL import Image, ImageDraw

from wbc import style
from wbc.moving_target.knowledge import Knowledge
from wbc.moving_target.study import Study
from wbc.moving_target.trial import Trial
from wbc.shapes import Box, Cylinder, PlacedShape
from wbc.track import render
from wbc.track.film import save_film
from wbc.track.scene import link_meshes, simplified
from wbc.validation import Array

COLOURS = dict(zip(Knowledge, style.CYCLE, strict=False))
LABELS = {
    Knowledge.NONE: "no compensation",
    Knowledge.POSE: "exact pose, no feed-forward",
    Knowledge.TWIST: "exact pose and twist",
    Knowledge.LATE: "measured pose, late",
    Knowledge.ESTIMATED: "measured, filtered, predicted",
}
#: Width and height of one half of the film [pixels], rays along each side of one, pictures a second, and at most
SIZE, RAYS, FRAMES_PER_SECOND, MOST = (360, 360), 2, 5, 40
#: Colours of the robot, the object, the tool and the hole
LINK, OBJECT, TOOL, MOUTH = (0.88, 0.89, 0.91), (0.80, 0.66, 0.45), (0.12, 0.37, 0.66), (0.16, 0.14, 0.13)


def plot(study: Study, done: Mapping[Knowledge, list[Trial]], folder: pathlib.Path) -> list[pathlib.Path]:
    """Errors and object of the first trial, and all trials' worst errors; returns the files."""
    first = {kind: trials[0] for kind, trials in done.items() if trials}
    files = [folder / name for name in ("error.png", "object.png", "trials.png")]
    with style.pyplot() as plt:
        figure, panels = plt.subplots(2, 1, figsize=(9, 6.5), sharex=True, layout="constrained")
        for kind, trial in first.items():
            for panel, part, scale in zip(panels, (slice(0, 3), slice(3, 6)), (1e3, 180.0 / np.pi), strict=True):
                size = scale * np.linalg.norm(trial.error[:, part], axis=1)
                panel.semilogy(trial.t, np.maximum(size, 1e-4), color=COLOURS[kind], label=LABELS[kind])
            if np.isfinite(trial.began):
                panels[0].axvline(trial.began, color=COLOURS[kind], lw=0.8, ls=":")
        panels[0].axhline(1e3 * study.scenario.clearance, color=style.INK, lw=0.8, ls="--")
        panels[0].set(ylabel="mm", title="Error in the object's frame, first trial; dashed: allowed, dotted: goes in")
        panels[1].set(ylabel="degrees", xlabel="s")
        panels[0].legend(fontsize=9, loc="lower left")
        figure.savefig(files[0])
        plt.close(figure)
        _object(plt, study, max(float(trial.t[-1]) for trial in first.values()), files[1])
        _trials(plt, study, done, files[2])
    return files


def _object(plt: object, study: Study, end: float, file: pathlib.Path) -> None:
    """How the object of the first trial moves, from where it is at first."""
    motion, times = study.moves(0), np.linspace(0.0, end, 400)
    first = motion.at(0.0).pose
    poses = [motion.at(float(t)).pose for t in times]
    place = 1e3 * np.array([pose.translation - first.translation for pose in poses])
    turn = np.degrees([pin.log3(pose.rotation @ first.rotation.T) for pose in poses])
    figure, panels = plt.subplots(2, 1, figsize=(9, 5), sharex=True, layout="constrained")  # type: ignore[attr-defined]
    for panel, rows, unit in zip(panels, (place, turn), ("mm", "degrees"), strict=True):
        for row, name in zip(rows.T, "xyz", strict=True):
            panel.plot(times, row, label=name)
        panel.set(ylabel=unit)
    panels[0].set(title=f"The object ({study.motion}), first trial")
    panels[0].legend(ncols=3)
    panels[1].set(xlabel="s")
    figure.savefig(file)
    plt.close(figure)  # type: ignore[attr-defined]


def _trials(plt: object, study: Study, done: Mapping[Knowledge, list[Trial]], file: pathlib.Path) -> None:
    """Largest error of each trial while working; filled: done."""
    figure, panel = plt.subplots(figsize=(9, 4), layout="constrained")  # type: ignore[attr-defined]
    rng = np.random.default_rng(0)
    for row, (kind, trials) in enumerate(done.items()):
        for trial in trials:
            worst = 1e3 * float(np.linalg.norm(trial.error[trial.working, :3], axis=1).max())
            y = row + rng.uniform(-0.25, 0.25)
            face = COLOURS[kind] if trial.success else "none"
            panel.plot(worst, y, "o", ms=4, mec=COLOURS[kind], mfc=face, mew=0.8)
    panel.axvline(1e3 * study.scenario.clearance, color=style.INK, lw=0.8, ls="--")
    names = [f"{LABELS[k]}\n{sum(t.success for t in ts)} of {len(ts)}" for k, ts in done.items()]
    panel.set(xscale="log", xlabel="largest error in the object's frame while working [mm]; filled: it was done")
    panel.set_yticks(range(len(names)), names)
    panel.invert_yaxis()
    figure.savefig(file)
    plt.close(figure)  # type: ignore[attr-defined]


def film(
    study: Study,
    pair: Mapping[Knowledge, Trial],
    file: pathlib.Path,
    progress: Callable[[float], None] | None = None,
    stop: Callable[[], bool] | None = None,
) -> pathlib.Path | None:
    """Trials side by side as an MP4 where an encoder is installed, else a GIF; None if ``stop`` ended it."""
    robot, scale = study.scenario.robot, study.scenario.size
    links = [(name, simplified(mesh, 0.1 * scale)) for name, mesh in link_meshes(robot)]
    camera = _camera(study, scale)
    end = max(float(trial.t[-1]) for trial in pair.values())
    times = np.linspace(0.0, end, int(np.clip(end * FRAMES_PER_SECOND, 2, MOST)))
    frames: list[Image.Image] = []
    for k, t in enumerate(times):
        if stop is not None and stop():
            return None
        halves = []
        for kind, trial in pair.items():
            row = min(int(np.searchsorted(trial.t, t)), len(trial.t) - 1)
            over = t >= trial.t[-1]
            ending = "" if not over else " - done" if trial.success else f" - {trial.reason}"
            picture = Image.fromarray(_drawn(study, links, trial, row, camera, scale))
            ImageDraw.Draw(picture).text((8, 8), f"{LABELS[kind]}\n{trial.t[row]:5.2f} s{ending}", fill=(34, 39, 46))
            halves.append(np.asarray(picture))
        frames.append(Image.fromarray(np.concatenate(halves, axis=1)))
        if progress is not None:
            progress((k + 1) / len(times))
    return save_film(frames, file, min(25.0, len(times) / max(end, 1e-9)), 128)


def _camera(study: Study, scale: float) -> render.Camera:
    """Beside the goal as it is at first, across the way in, a little from above."""
    goal = study.moves(0).at(0.0).pose * study.scenario.goal
    inward = goal.rotation[:, 2]
    up = np.array([0.0, 0.0, 1.0])
    side = np.cross(inward, up) if abs(inward[2]) < 0.9 else np.array([0.75, -0.66, 0.0])
    direction = side / np.linalg.norm(side) + 0.35 * up
    target = goal.translation - 0.8 * scale * inward
    away = 16.0 * scale * direction / np.linalg.norm(direction)
    return render.Camera(target + away, target, np.radians(24.0), RAYS * SIZE[0], RAYS * SIZE[1])


def _drawn(
    study: Study, links: list[tuple[str, Array]], trial: Trial, row: int, camera: render.Camera, scale: float
) -> np.ndarray:
    """One picture, [height, width, 3] bytes."""
    s, robot = study.scenario, study.scenario.robot
    data = robot.model.createData()
    pin.framesForwardKinematics(robot.model, data, trial.q[row])
    meshes = []
    for name, mesh in links:
        pose = data.oMf[robot.model.getFrameId(name)]
        meshes.append(render.ColouredMesh(mesh @ pose.rotation.T + pose.translation, LINK))
    tool = data.oMf[robot.model.getFrameId(s.tip)] * s.tool
    goal = pin.XYZQUATToSE3(trial.goal[row])
    back = pin.SE3(np.eye(3), np.array([0.0, 0.0, -0.4 * scale]))
    radius = 0.15 * scale
    meshes.append(_piece(Cylinder(radius, 0.8 * scale), tool * back, TOOL))
    thick = max(s.lead, 0.4 * scale)
    below = pin.SE3(np.eye(3), np.array([0.0, 0.0, 0.5 * thick - s.lead]))
    meshes.append(_piece(Box((5.0 * scale, 5.0 * scale, thick)), goal * below, OBJECT))
    mouth = pin.SE3(np.eye(3), np.array([0.0, 0.0, -s.lead]))
    meshes.append(_piece(Cylinder(1.5 * radius, 0.02 * scale), goal * mouth, MOUTH))
    layer = render.draw(meshes, camera)
    seen, colours = render.shade(layer, camera, None)
    image = np.ones((camera.height, camera.width, 3))
    image[seen] = colours
    return np.asarray(np.clip(255.0 * render.reduced(image, RAYS), 0, 255), dtype=np.uint8)


def _piece(shape: Box | Cylinder, pose: pin.SE3, colour: tuple[float, float, float]) -> render.ColouredMesh:
    mesh = render.triangles(PlacedShape(shape, pin.SE3.Identity()))
    return render.ColouredMesh(mesh @ pose.rotation.T + pose.translation, colour)
