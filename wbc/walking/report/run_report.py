"""``report.html`` of a walk: what was asked for, whether it was kept, and the pictures of the folder."""

from __future__ import annotations

import pathlib

import numpy as np

from wbc.track.page import RunPage
from wbc.walking.checker import Report
from wbc.walking.report.figures import figures_of
from wbc.walking.run.session import WalkRun

#: Pictures that a folder may have, in the order of the page
PICTURES = (
    "walk.png",
    "walk.gif",
    "walk.mp4",
    "holds.png",
    "margins.png",
    "speed.png",
    "joints.png",
    "rates.png",
    "drift.png",
    "loads.png",
)


def save_report(run: WalkRun, folder: pathlib.Path, report: Report | None) -> pathlib.Path:
    """Write the page; returns the file.

    Args:
        report: of the external checker, None where it was not asked.
    """
    judged = run.judged(report)
    page = RunPage(f"Walk on {run.structure.name}", f"{run.walker.robot.name}, {len(run.structure)} holds")
    page.section("Asked for, and whether it was kept")
    why = f": {judged.reason}" if judged.reason else ""
    page.verdict(judged.well, f"arrive where it was sent ({judged.outcome}{why})")
    if report is None:
        page.text("The walk was not checked.")
    else:
        page.verdict(report.ok, "keep every rule of the checker, which shares no code with planner and control")
        page.verbatim(str(report))
    page.section("Figures")
    page.figures(figures_of(run, report))
    if run.log is not None and run.ticks is not None and len(run.ticks.cost):
        page.section("Ticks whose constraints did not all hold")
        times = run.log.t[: len(run.ticks.solved)]
        page.strips(times, {"not all rows held": np.where(run.ticks.solved, 0.0, 1.0)})
        page.section("Time of a tick")
        page.histogram(1e6 * run.ticks.cost, "us")
    page.section("Pictures")
    for name in PICTURES:
        page.picture(folder / name)
    page.section("Files")
    page.links(
        folder,
        {
            "replay.html": "the walk, played in the browser without a network",
            "summary.json": "these figures for programs",
            "check.txt": "what the checker found",
            "walk.gif": "a film",
            "walk.mp4": "a film",
        },
    )
    return page.save(folder)
