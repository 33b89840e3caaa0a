"""The folder of a run: log, plan, machine and structure first, then what is shown of them."""

from __future__ import annotations

import pathlib
from collections.abc import Callable

import numpy as np

from wbc.errors import WbcError
from wbc.robots import Walker
from wbc.walking.checker import Report, Rules, check_run
from wbc.walking.checker.clock_and_joints import JUMP, SPIN_JUMP
from wbc.walking.holds.files import save_structure
from wbc.walking.report.animation import save_animation
from wbc.walking.report.figures import figures_of, save_figures
from wbc.walking.report.plots import save_plots
from wbc.walking.report.reach_map import save_reach_map
from wbc.walking.report.replay_page import ReplayPageError, save_replay_page
from wbc.walking.report.stills import save_stills
from wbc.walking.run.carrying_out import Progress
from wbc.walking.run.session import WalkRun
from wbc.walking.two_ended import touching_distance

PLAN, STRUCTURE, URDF = "plan.json", "structure.csv", "robot.urdf"
#: All files of a run, which the next one in the same folder does not leave behind
WRITTEN = (
    *("run.npz", "ticks.npz", "published.npz", PLAN, STRUCTURE, URDF, "check.txt", "summary.json", "summary.txt"),
    *(f"{name}.png" for name in ("holds", "margins", "joints", "rates", "drift", "wrists", "speed", "tick_time")),
    *("reach_map.png", "walk.png", "still_*.png", "walk.gif", "replay.html"),
)


class RunFolderError(WbcError):
    """A run folder that cannot be written, or that has a run already."""


def make_folder(folder: pathlib.Path, force: bool = False) -> pathlib.Path:
    """The folder, made, without the files of an earlier run.

    Raises:
        RunFolderError: it has a run and ``force`` is off, or it cannot be written.
    """
    if (folder / "summary.json").exists() and not force:
        raise RunFolderError("out", str(folder), "there is a run in this folder; choose another, or use --force")
    try:
        folder.mkdir(parents=True, exist_ok=True)
        for file in [file for name in WRITTEN for file in folder.glob(name)]:
            file.unlink()
        # A folder that can be seen but not written says so before anything is computed
        probe = folder / ".probe"
        probe.touch()
        probe.unlink()
    except OSError as error:
        raise RunFolderError("out", str(folder), f"cannot be written: {error.strerror}") from error
    return folder


def save_run(run: WalkRun, folder: pathlib.Path, check: bool = True) -> tuple[list[pathlib.Path], Report | None]:
    """Everything that is needed to read, check and repeat the run; (files, what the checker found).

    Args:
        check: run the external checker.
    """
    files = [save_structure(run.structure, folder / STRUCTURE), run.walker.urdf(folder / URDF)]
    if run.plan is not None:
        files.append(run.plan.save(folder / PLAN))
    report = None
    if run.log is not None and run.ticks is not None:
        files += [run.log.save(folder), run.ticks.save(folder)]
        report = check_run(folder, rules_of(run.walker)) if check else None
        if report is not None:
            files.append(folder / "check.txt")
            files[-1].write_text(f"{report}\n")
    return [*files, *save_figures(figures_of(run, report), folder)], report


def rules_of(walker: Walker) -> Rules:
    """What the checker goes by: the accelerations of the joints; tips of the two-ended arm are thicker than hands."""
    names = [joint for arm in walker.arms for joint in arm.joints]
    limits = np.concatenate([walker.robot.limits.acceleration[arm.v] for arm in walker.arms])
    found = dict(zip(names, limits.tolist(), strict=True))
    if walker.two_ended:
        # Its body is its elbow, which goes as fast as the joints take it
        return Rules(exempt_distance=touching_distance(walker), accelerations=found, observe=(JUMP, SPIN_JUMP))
    return Rules(accelerations=found)


def save_pictures(
    run: WalkRun, folder: pathlib.Path, progress: Progress | None = None, stop: Callable[[], bool] | None = None
) -> tuple[list[pathlib.Path], list[str]]:
    """Plots, map, stills, animation and page; (files, what could not be made and why).

    Args:
        stop: asked between pictures and frames; true ends it.
    """
    told, asked = progress or (lambda what, part: None), stop or (lambda: False)
    files, missing = list[pathlib.Path](), list[str]()
    if not run.walker.two_ended:
        told("reach map", None)
        files.append(save_reach_map(run, folder))
    log, ticks = run.log, run.ticks
    if log is None or ticks is None or asked():
        return files, missing
    told("plots", None)
    files += save_plots(run, log, ticks, folder)
    told("replay page", None)
    try:
        files += [page for page in [save_replay_page(run, log, folder, asked)] if page is not None]
    except ReplayPageError as error:
        missing.append(str(error))
    if not asked():
        told("stills", None)
        files += save_stills(run, log, folder, stop=asked)
    told("animation", 0.0)
    film = save_animation(run, log, folder, progress=lambda part: told("animation", part), stop=asked)
    return files + ([film] if film is not None else []), missing
