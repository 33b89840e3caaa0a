"""``report.html`` of a session of manual control, from its log."""

from __future__ import annotations

import pathlib

import numpy as np

from wbc.controller import Status
from wbc.teleop.loop import SessionLog
from wbc.teleop.session import Teleoperation
from wbc.track.page import RunPage, stretches
from wbc.track.summary import Figure
from wbc.validation import Array

#: Part of the command above which what is missing counts as lost
LOST = 0.01
#: Losses that are told with their reasons, at most
TOLD = 5


def session_figures(session: Teleoperation, log: SessionLog) -> list[Figure]:
    """What came of a session."""
    statuses = log.status
    counts = {status: statuses.count(status) for status in dict.fromkeys(statuses)}
    fastest = max((float(np.abs(v).max(initial=0.0)) for v in log.v), default=0.0)
    worst = max((log.lost[k] for k in log.lost_in(0.0)), default=0.0)
    names = list(dict.fromkeys(log.active))
    return [
        Figure("status", "ticks", counts, ", ".join(f"{n} {name}" for name, n in counts.items()) or "none"),
        Figure("pairs", "pairs in use", names, ", ".join(names)),
        Figure("fastest", "fastest joint", fastest, f"{fastest:.4g} rad/s"),
        Figure("lost", "largest part of the command that was lost, ramps aside", worst, f"{100.0 * worst:.3g} %"),
        Figure("late", "ticks that began late", log.late, str(log.late)),
        Figure("start", "start", log.q[0].tolist() if log.q else [], _numbers(log.q[0]) if log.q else "none"),
    ]


def save_report(session: Teleoperation, log: SessionLog, folder: pathlib.Path) -> pathlib.Path:
    """Write ``report.html``; returns the file.

    Raises:
        WbcError: it cannot be written.
    """
    ticks, robot = len(log.time), session.robot
    page = RunPage(f"{robot.name} driven by rates", f"{ticks} ticks of {1e3 * session.control.dt:g} ms")
    page.section("Asked for, and whether it was kept")
    lost = np.array([0.0 if seen.ramping else seen.lost for seen in log.seen])
    followed = ticks - len(log.lost_in(LOST))
    page.verdict(
        followed == ticks,
        f"rates as they were ordered, to {100 * LOST:g} %, or rising to them: in {followed} of {ticks} ticks",
    )
    if ticks:
        rates, limit = np.abs(np.array(log.v)), robot.limits.velocity
        page.verdict(bool((rates <= limit * (1.0 + 1e-9) + 1e-12).all()), "velocity limits of all joints")
        solved = sum(seen.step.ended is Status.SOLVED for seen in log.seen)
        page.verdict(solved == ticks, f"all constraints hold in every tick: in {solved} of {ticks}")
    page.verdict(not log.interrupted, "done to the end" if not log.interrupted else "ended by Ctrl-C")
    page.section("Figures")
    page.figures(session_figures(session, log))
    if ticks:
        columns, times = log.columns(robot), np.array(log.time)
        for title, group in (("What bound when", "binding"), ("Pairs", "pair"), ("What was lost, and why", "why")):
            page.section(title)
            page.strips(times, columns.group(group))
        found = stretches(np.asarray(lost > LOST, dtype=float))
        for first, last in sorted(found, key=lambda pair: pair[0] - pair[1])[:TOLD]:
            worst = first + int(lost[first:last].argmax())
            seen = log.seen[worst]
            page.text(
                f"{times[first]:.3g} s to {times[last - 1]:.3g} s: at most {100 * lost[worst]:.3g} % of the command "
                f"with {seen.active}; {'; '.join(seen.why)}."
            )
        page.section("Processor time of a tick")
        page.histogram(1e6 * np.array(log.cost), "us")
    page.section("Files")
    page.links(
        folder,
        {
            "replay.html": "the session, played in the browser without a network",
            "log.csv": "every tick",
            "log.npz": "every tick, for wbc.log.load",
        },
    )
    return page.save(folder)


def _numbers(q: Array) -> str:
    return f"--at={','.join(f'{x:.4f}' for x in q)}"
