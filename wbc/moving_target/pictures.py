"""Plots and the film of trials on a moving object."""

from __future__ import annotations

import pathlib
from collections.abc import Callable, Mapping

import numpy as np
from PIL import Image, ImageDraw

from wbc import style
from wbc.moving_target.knowledge import Knowledge
from wbc.moving_target.study import TargetStudy
from wbc.moving_target.trial import TargetTrial
from wbc.multibody import pin
from wbc.shapes import Box, Cylinder, Solid
from wbc.track import render
from wbc.track.film import save_film
from wbc.track.scene import Colour, Scene

COLOURS = dict(zip(Knowledge, style.CYCLE, strict=False))
LABELS = {
    Knowledge.NONE: "no compensation",
    Knowledge.POSE: "exact pose, no feed-forward",
    Knowledge.TWIST: "exact pose and twist",
    Knowledge.LATE: "measured pose, late",
    Knowledge.ESTIMATED: "measured, filtered, predicted",
}
#: Width and height of one half of the film [pixels]
SIZE = (360, 360)
#: Pictures of the film a second [1/s]
FRAMES_PER_SECOND = 5
#: Pictures of the film, at most
MOST = 40
#: Colour of the robot
LINK = (0.88, 0.89, 0.91)
#: Colour of the object
OBJECT = (0.80, 0.66, 0.45)
#: Colour of the tool
TOOL_COLOUR = (0.12, 0.37, 0.66)
#: Colour of the hole
MOUTH = (0.16, 0.14, 0.13)


def plot(study: TargetStudy, done: Mapping[Knowledge, list[TargetTrial]], folder: pathlib.Path) -> list[pathlib.Path]:
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


def _object(plt: object, study: TargetStudy, end: float, file: pathlib.Path) -> None:
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


def _trials(plt: object, study: TargetStudy, done: Mapping[Knowledge, list[TargetTrial]], file: pathlib.Path) -> None:
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
    study: TargetStudy,
    pair: Mapping[Knowledge, TargetTrial],
    file: pathlib.Path,
    progress: Callable[[float], None] | None = None,
    stop: Callable[[], bool] | None = None,
) -> pathlib.Path | None:
    """Trials side by side as an MP4 where an encoder is installed, else a GIF; None if ``stop`` ended it."""
    robot, scale = study.scenario.robot, study.scenario.size
    scene = Scene(robot, detail=0.1 * scale, colours={"*": LINK})
    shot = scene.film(_camera(study, scale))
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
            scene.add_robot(trial.q[row], pieces=_pieces(study, trial, row, scale))
            picture = Image.fromarray(shot())
            ImageDraw.Draw(picture).text((8, 8), f"{LABELS[kind]}\n{trial.t[row]:5.2f} s{ending}", fill=(34, 39, 46))
            halves.append(np.asarray(picture))
        frames.append(Image.fromarray(np.concatenate(halves, axis=1)))
        if progress is not None:
            progress((k + 1) / len(times))
    return save_film(frames, file, min(25.0, len(times) / max(end, 1e-9)), 128)


def _camera(study: TargetStudy, scale: float) -> render.Camera:
    """Beside the goal as it is at first, across the way in, a little from above."""
    goal = study.moves(0).at(0.0).pose * study.scenario.goal
    inward = goal.rotation[:, 2]
    up = np.array([0.0, 0.0, 1.0])
    side = np.cross(inward, up) if abs(inward[2]) < 0.9 else np.array([0.75, -0.66, 0.0])
    direction = side / np.linalg.norm(side) + 0.35 * up
    target = goal.translation - 0.8 * scale * inward
    away = 16.0 * scale * direction / np.linalg.norm(direction)
    return render.Camera(target + away, target, np.radians(24.0), *SIZE)


def _pieces(study: TargetStudy, trial: TargetTrial, row: int, scale: float) -> list[tuple[Solid, pin.SE3, Colour]]:
    """The tool, and a piece of the object round the hole."""
    s, radius = study.scenario, 0.15 * scale
    tool, goal = s.robot.pose(trial.q[row], s.tip) * s.tool, pin.XYZQUATToSE3(trial.goal[row])
    thick = max(s.lead, 0.4 * scale)
    return [
        (Cylinder(radius, 0.8 * scale), tool * _along(-0.4 * scale), TOOL_COLOUR),
        (Box((5.0 * scale, 5.0 * scale, thick)), goal * _along(0.5 * thick - s.lead), OBJECT),
        (Cylinder(1.5 * radius, 0.02 * scale), goal * _along(-s.lead), MOUTH),
    ]


def _along(z: float) -> pin.SE3:
    return pin.SE3(np.eye(3), np.array([0.0, 0.0, z]))
