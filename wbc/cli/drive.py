"""``wbc drive``: an arm by rates from a file or the keyboard."""

from __future__ import annotations

import contextlib
from itertools import pairwise
from pathlib import Path
from typing import Annotated

import numpy as np
import typer
from rich.markup import escape

from wbc.cli import completion
from wbc.cli.analysis.advise import configuration_of
from wbc.cli.console import err, out
from wbc.cli.folders import filled, run_folder
from wbc.cli.options import Backend
from wbc.coordinates import Condition, parts
from wbc.errors import RangeError, UnknownNameError
from wbc.extras import MissingPackageError
from wbc.robot import Robot
from wbc.robots import load
from wbc.teleop import Keyboard, RateFile, Seen, SessionLog, Teleoperation, run_session
from wbc.teleop.keyboard import HELP
from wbc.teleop.session import NOTHING

#: Parts of a command between which losses are distinguished, and the exit code after Ctrl-C
STEPS, INTERRUPTED = (NOTHING, 0.01, 0.1, 0.5), 130
#: Files of a session's folder
LOG, REPLAY = "log.csv", "replay.html"
WRITTEN = (LOG, "report.html", REPLAY)
#: While only the loss changes, a line after so long [s]
PAUSE = 0.5
#: The live line is written anew after so long [s]
LIVE = 0.1


def drive(
    robot: Annotated[
        str,
        typer.Argument(
            help="A name of `wbc modes` or `wbc robots`, or a URDF or MJCF file.", autocompletion=completion.robots
        ),
    ],
    rates: Annotated[Path | None, typer.Option(help="CSV file of orders: time, pair, r1 ... r6.")] = None,
    keys: Annotated[bool, typer.Option("--keys", help="Orders from the keyboard, at 50 Hz.")] = False,
    mode: Annotated[
        list[str] | None, typer.Option(help="Modes whose pairs there are; default M1 and M2, where the robot has them.")
    ] = None,
    at: Annotated[
        str, typer.Option(help="First configuration, numbers with commas. Default: one away from singular ones.")
    ] = "",
    automatic: Annotated[bool, typer.Option("--automatic", help="Change pairs as the adviser says.")] = False,
    realtime: Annotated[bool, typer.Option("--realtime", help="Wait for the clock with a file, too.")] = False,
    log: Annotated[Path | None, typer.Option(help="Write what happened to this CSV file, after Ctrl-C, too.")] = None,
    teach: Annotated[
        Path | None, typer.Option(help="Write the orders to this CSV file, which --rates carries out again.")
    ] = None,
    output: Annotated[
        Path | None,
        typer.Option("--out", "--output", help="A folder for log.csv, report.html and replay.html, after Ctrl-C, too."),
    ] = None,
    force: Annotated[bool, typer.Option("--force", help="Write into a folder that has a run.")] = False,
    scaled: Annotated[
        bool, typer.Option("--scaled", help="Rates that joints are too slow for keep their direction.")
    ] = False,
    backend: Backend = "auto",
) -> None:
    """Drive an arm by rates: the pair of coordinates that is chosen, at most six rates at a time, 50 times a second.

    What of a command is lost is said, with the reason and the pair to use; the log has it tick by tick.
    """
    if keys == (rates is not None):
        raise RangeError("rates", rates, "give either --rates FILE or --keys")
    folder = None if output is None else run_folder(output, "drive", WRITTEN, force)
    machine = _standing(robot)
    given = configuration_of(parts(machine).robot, at) if at else None
    source = RateFile(rates) if rates is not None else None
    err().print(f"starting {escape(robot)} ...", soft_wrap=True)
    session = Teleoperation(machine, mode or None, automatic=automatic, scaled=scaled, backend=backend)
    q = session.start() if given is None else given
    if given is None:
        err().print(f"from --at={','.join(f'{x:.4f}' for x in q)}", soft_wrap=True, markup=False)
    _warn(session, q)
    found, progress = SessionLog(), _Teller()
    try:
        if source is not None:
            run_session(session, source, q, realtime=realtime, progress=progress, log=found)
        else:
            err().print(HELP, soft_wrap=True)
            with Keyboard().terminal() as keyboard, _Line(session, found, progress) as line:
                run_session(session, keyboard, q, realtime=True, progress=line, log=found)
    finally:
        _report(found, session, log)
        if teach is not None and found.time:
            start = ",".join(repr(x) for x in found.q[0].tolist())
            text = f"again: wbc drive {robot} --rates {found.save_orders(teach)} --at={start}"
            out().print(text + "".join(f" --mode {one}" for one in mode or ()), soft_wrap=True, markup=False)
        if folder is not None:
            out().print(escape(f"{folder}: {', '.join(_pages(found, session, folder))}"), soft_wrap=True)
    if found.interrupted:
        raise typer.Exit(INTERRUPTED)


def _pages(found: SessionLog, session: Teleoperation, folder: Path) -> list[str]:
    """Names of the files of a session's folder."""
    from wbc.teleop.report import save_report
    from wbc.viewer.errors import ViewerError
    from wbc.viewer.runs import save_motion

    with filled(folder) as fresh:
        found.write(fresh / LOG, session.robot.dof_names)
        # A session is worth keeping where what draws the page is not installed, and without a tick there is none
        with contextlib.suppress(ViewerError, MissingPackageError):
            save_motion(session.robot, found.time, found.q, fresh / REPLAY)
        save_report(session, found, fresh)
    return [name for name in WRITTEN if (folder / name).is_file()]


def _standing(name: str) -> str | Robot:
    """What is driven: a robot that floats, such as a humanoid, with its base held."""
    try:
        base = load(name, shapes="none").base
    except UnknownNameError:
        return name
    if base != "floating":
        return name
    err().print(f"{escape(name)} floats: its base is held where it is", soft_wrap=True)
    return load(name, base="fixed")


class _Line:
    """The last line of a terminal, while keys are pressed: pose of what is commanded, its rate, and what binds."""

    def __init__(self, session: Teleoperation, found: SessionLog, tell: _Teller) -> None:
        self._session, self._found, self._tell, self._console = session, found, tell, err()
        self._after = -LIVE

    def __enter__(self) -> _Line:
        return self

    def __exit__(self, *_: object) -> None:
        self._clear()

    def _clear(self) -> None:
        if self._console.is_terminal:
            self._console.file.write("\r\x1b[K")
            self._console.file.flush()

    def __call__(self, time: float, seen: Seen) -> None:
        if self._tell.has_news(time, seen):
            self._clear()
            self._tell(time, seen)
        if self._console.is_terminal and time >= self._after + LIVE:
            self._after = time
            self._clear()
            self._console.file.write(self.text(time, seen)[: self._console.width - 1])
            self._console.file.flush()

    def text(self, time: float, seen: Seen) -> str:
        """The line, without regard to the terminal's width."""
        parts = [f"{time:7.1f} s"]
        frame = getattr(self._session.control.pair.task, "frame", "")
        if frame in self._session.robot.frame_names:
            place = self._session.robot.pose(self._found.q[-1], frame).translation
            parts.append(f"{frame} at ({', '.join(f'{x:.3f}' for x in place)}) m")
        parts.append(f"rate {_rates(seen.met)}")
        binding = ", ".join(str(one) for one in seen.step.binding[:2])
        return "  ".join([*parts, f"binds: {binding}" if binding else "nothing binds"])


class _Teller:
    """A line when something changes."""

    def __init__(self) -> None:
        self._last: tuple[object, ...] = ()
        self._loss, self._time = -1, -PAUSE

    def has_news(self, time: float, seen: Seen) -> bool:
        """Whether there is something to say that was not said."""
        state, loss = self._state(seen)
        return state != self._last or (loss != self._loss and time >= self._time + PAUSE)

    @staticmethod
    def _state(seen: Seen) -> tuple[tuple[object, ...], int]:
        state = seen.active, seen.blending, seen.step.status, seen.advised
        return state, sum(seen.lost > step for step in STEPS)

    def __call__(self, time: float, seen: Seen) -> None:
        if not self.has_news(time, seen):
            return
        self._last, self._loss = self._state(seen)
        self._time = time
        text = f"{seen.active}{' (changing)' if seen.blending else ''}, {seen.step.status}, sigma {seen.sigma:.2g}"
        text += f" ({seen.kept:.2f} of the task's)"
        if seen.advised != seen.active:
            text += f", better: {seen.advised}"
        if seen.lost > NOTHING:
            text += f"; lost {100 * seen.lost:.2g} %: asked {_rates(seen.asked)}, met {_rates(seen.met)}"
        if seen.why:
            text += f": {', '.join(seen.why)}"
        err().print(f"{time:8.2f} s  {escape(text)}", soft_wrap=True)


def _rates(numbers: np.ndarray) -> str:
    return f"({', '.join(f'{x:.3g}' for x in numbers)})"


def _warn(session: Teleoperation, q: object) -> None:
    """The first pair is near the loss of its rank where the session begins."""
    first = session.control.active
    here = next(one for one in session.adviser.advise(q) if one.pair == first)
    if here.condition is not Condition.REGULAR:
        what = "the task itself is" if here.condition is Condition.TASK else f"{first!r} is"
        better = session.adviser.recommend(q, first)
        hint = f"; better: {better!r}" if better != first else ""
        text = f"this start is {min(here.distance, session.adviser.near):.2g} rad from where {what} singular{hint}"
        err().print(f"warning: {escape(text)}", soft_wrap=True)


def _report(found: SessionLog, session: Teleoperation, log: Path | None) -> None:
    status, active = found.status, found.active
    statuses = ", ".join(f"{status.count(s)} {s}" for s in dict.fromkeys(status))
    fastest = max((float(np.abs(v).max()) for v in found.v), default=0.0)
    changes = sum(a != b for a, b in pairwise(active))
    ended = ", ended by Ctrl-C" if found.interrupted else ""
    out().print(
        f"{len(found.time)} ticks: {statuses or 'none'}; fastest joint {fastest:.4g} rad/s, "
        f"{changes} changes of pairs, {found.late} late{ended}",
        soft_wrap=True,
    )
    ramps = sum(seen.ramping for seen in found.seen)
    late = f"late, and not lost, in {ramps} ticks while rates rise or fall" if ramps else ""
    if ticks := found.lost_in(STEPS[1]):
        worst = found.seen[ticks[0]]
        text = (
            f"lost: more than 1 % of the command in {len(ticks)} ticks, at most {100 * worst.lost:.2g} % "
            f"at {found.time[ticks[0]]:.2f} s with {worst.active}: {', '.join(worst.why)}; "
            f"{session.nearest_locus(found.q[ticks[0]], worst.active)}"
        )
        out().print(escape(f"{text}; {late}" if late else text), soft_wrap=True)
    elif late:
        out().print(f"nothing of the command was lost; it was {late}", soft_wrap=True)
    if log is not None:
        out().print(escape(str(found.write(log, session.robot.dof_names))), soft_wrap=True)
