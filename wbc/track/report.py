"""The report of a tracking run, from its log."""

from __future__ import annotations

import pathlib
from collections.abc import Mapping, Sequence

import numpy as np

from wbc.controller import Status
from wbc.log import Log
from wbc.track.page import RunPage, stretches
from wbc.track.run import STATUSES
from wbc.track.summary import Figure, position_errors

#: A frame that is off its target by less than this followed it [m]
FOLLOWED = 1e-3
#: What a margin or limit may be off by rounding
ROUNDING = 1e-6
#: Conflicts that are explained
EXPLAINED = 5


def save_report(
    log: Log, figures: Sequence[Figure], folder: pathlib.Path, said: Mapping[int, str] | None = None
) -> pathlib.Path:
    """Write ``report.html`` with the pictures that are in the folder; returns the file.

    Args:
        said: number of a tick -> why it was as it was, see :func:`conflicts`.
    """
    meta = log.meta
    page = RunPage(f"{meta['robot']} follows {meta['path']}", f"frame {meta['frame']}, {meta['duration']:g} s")
    page.section("Asked for, and whether it was kept")
    if len(log):
        worst = float(position_errors(log).max())
        page.verdict(worst < FOLLOWED, f"follow the path: at most {1e3 * worst:.3g} mm off")
        gaps = log.group("clearance")
        if gaps:
            least = min(float(gap.min()) for gap in gaps.values())
            asked = float(meta["margin"])
            line = f"keep {1e3 * asked:g} mm from obstacles: at least {1e3 * least:.3g} mm"
            page.verdict(least >= asked - ROUNDING, line)
        for name, columns in (("position", "q"), ("velocity", "v"), ("acceleration", "a")):
            _limit(page, log, name, columns)
        solved = int((log["status"] == STATUSES.index(Status.SOLVED)).sum())
        page.verdict(solved == len(log), f"all constraints hold in every tick: in {solved} of {len(log)}")
    page.verdict(not meta["interrupted"], f"done to the end: {meta['ticks']} of {meta['planned']} ticks")
    page.section("Figures")
    page.figures(figures)
    if len(log):
        page.section("What bound when")
        page.strips(log["t"], log.group("binding"))
        page.section("Conflicts")
        relaxed = {f"{name} gave way": values != 0.0 for name, values in log.group("relaxed").items()}
        other = {f"status {status}": log["status"] == k for k, status in enumerate(STATUSES) if k}
        page.strips(log["t"], {**relaxed, **other})
        for tick, text in (said or {}).items():
            page.text(f"At {float(log['t'][tick]):.3g} s: {text}")
        page.section("Time of a tick")
        page.histogram(1e6 * log["tick"], "us")
    page.section("Pictures")
    for name in ("overview", "errors", "clearance", "plane", "joints", "velocities", "accelerations"):
        page.picture(folder / f"{name}.png")
    page.section("Files")
    page.links(
        folder,
        {
            "replay.html": "the run, played in the browser without a network",
            "summary.json": "these figures for programs",
            "log.parquet": "every tick",
            "log.npz": "every tick",
            "ticks.npz": "inputs of every tick, for wbc replay and wbc view",
        },
    )
    page.section("The stack")
    page.verbatim(str(meta["stack"]))
    return page.save(folder)


def conflicts(log: Log) -> list[int]:
    """Ticks to be explained: where each of the longest stretches begins in which not all rows held."""
    found = stretches(log["status"] != STATUSES.index(Status.SOLVED))
    longest = sorted(found, key=lambda pair: pair[0] - pair[1])[:EXPLAINED]
    return sorted(first for first, _ in longest)


def _limit(page: RunPage, log: Log, name: str, columns: str) -> None:
    """Whether the limits of all joints were kept, and which came nearest."""
    limits = log.meta["limits"]
    values = {dof: column for dof, column in log.group(columns).items() if dof in log.meta["dofs"]}
    worst, where = 0.0, ""
    for dof, column in values.items():
        k = log.meta["dofs"].index(dof)
        if name == "position":
            low, high = limits["position_lower"][k], limits["position_upper"][k]
            if low is None or high is None or not high > low:
                continue
            share = float(np.abs(2.0 * (column - low) / (high - low) - 1.0).max(initial=0.0))
        else:
            limit = limits[name][k]
            if not limit:
                continue
            share = float(np.abs(column).max(initial=0.0)) / limit
        if share > worst:
            worst, where = share, dof
    if where:
        page.verdict(worst <= 1.0 + ROUNDING, f"{name} limits: {where} came to {100 * worst:.4g} % of its limit")
