"""The folder of a run: log, plan, machine and structure first, then what is shown of them."""

from __future__ import annotations

import pathlib
from collections.abc import Callable

import numpy as np

from wbc.robots import Walker
from wbc.track.page import FILE as REPORT
from wbc.walking.checker import Report, Rules, check_run
from wbc.walking.holds.files import save_structure
from wbc.walking.log.folder import BEGUN, PLAN, STRUCTURE, URDF, write_whole
from wbc.walking.log.log import FILE, PART
from wbc.walking.report.animation import save_animation
from wbc.walking.report.figures import figures_of, save_figures
from wbc.walking.report.plots import save_plots
from wbc.walking.report.reach_map import save_reach_map
from wbc.walking.report.run_report import save_report
from wbc.walking.report.stills import save_stills
from wbc.walking.run.carrying_out import Progress
from wbc.walking.run.session import WalkRun
from wbc.walking.torque.loads import LOADS

CHECK = "check.txt"
#: All files of a run, which the next one in the same folder does not leave behind
WRITTEN = (
    *(BEGUN, FILE, PART, "published.npz", PLAN, STRUCTURE, f"{pathlib.Path(STRUCTURE).stem}-*.stl", URDF),
    *(CHECK, "summary.json", "summary.txt"),
    *(
        f"{name}.png"
        for name in ("holds", "margins", "joints", "rates", "drift", "wrists", "speed", "tick_time", "loads")
    ),
    LOADS,
    *("reach_map.png", "walk.png", "still_*.png", "walk.gif", "walk.mp4", "replay.html", REPORT),
)


def save_run(run: WalkRun, folder: pathlib.Path, check: bool = True) -> tuple[list[pathlib.Path], Report | None]:
    """Everything that is needed to read, check and repeat the run; (files, what the checker found).

    The files come in an order in which the folder can be read after each of them.

    Args:
        check: run the external checker.

    Raises:
        WbcError: a file cannot be written.
    """
    files = [save_structure(run.structure, folder / STRUCTURE), write_whole(folder / URDF, run.walker.urdf)]
    if run.plan is not None:
        files.append(write_whole(folder / PLAN, run.plan.save))
    report = None
    if run.log is not None and run.ticks is not None:
        files.append(run.log.save(folder, run.ticks))
        (folder / PART).unlink(missing_ok=True)
        if run.loads is not None:
            files.append(run.loads.save(folder))
        report = check_run(folder, rules_of(run.walker)) if check else None
        if report is not None:
            text = f"{report}\n"
            files.append(write_whole(folder / CHECK, lambda file: file.write_text(text)))
    return [*files, *save_figures(figures_of(run, report), folder), save_report(run, folder, report)], report


def rules_of(walker: Walker) -> Rules:
    """What the checker goes by: the accelerations of the joints."""
    names = [joint for arm in walker.arms for joint in arm.joints]
    limits = np.concatenate([walker.robot.limits.acceleration[arm.v] for arm in walker.arms])
    return Rules(accelerations=dict(zip(names, limits.tolist(), strict=True)))


def save_pictures(
    run: WalkRun, folder: pathlib.Path, progress: Progress | None = None, stop: Callable[[], bool] | None = None
) -> list[pathlib.Path]:
    """Plots, map, stills and film; returns the files.

    Args:
        stop: asked between pictures and frames; true ends it.
    """
    told, asked = progress or (lambda what, part: None), stop or (lambda: False)
    told("reach map", None)
    files = [save_reach_map(run, folder)]
    log, ticks = run.log, run.ticks
    if log is None or ticks is None or asked():
        return files
    told("plots", None)
    files += save_plots(run, log, ticks, folder)
    if not asked():
        told("stills", None)
        files += save_stills(run, log, folder, stop=asked)
    told("animation", 0.0)
    film = save_animation(run, log, folder, progress=lambda part: told("animation", part), stop=asked)
    return files + ([film] if film is not None else [])
