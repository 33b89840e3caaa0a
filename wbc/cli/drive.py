"""``wbc drive``: an operator's arm by rates from a file or the keyboard."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import numpy as np
import typer
from rich.markup import escape

from wbc.cli.advise import configuration_of
from wbc.cli.console import err, out
from wbc.cli.options import Backend
from wbc.coordinates import parts
from wbc.errors import RangeError
from wbc.teleop import Keyboard, RateFile, Seen, SessionLog, Teleoperation, run_session
from wbc.teleop.keyboard import HELP


def drive(
    robot: Annotated[str, typer.Argument(help="An arm of `wbc modes`.")],
    rates: Annotated[Path | None, typer.Option(help="CSV file of orders: time, pair, r1 ... r6.")] = None,
    keys: Annotated[bool, typer.Option("--keys", help="Orders from the keyboard, at 50 Hz.")] = False,
    mode: Annotated[list[str] | None, typer.Option(help="Modes whose pairs there are; default M1 and M2.")] = None,
    at: Annotated[str, typer.Option(help="First configuration, numbers with commas. Default: neutral.")] = "",
    automatic: Annotated[bool, typer.Option("--automatic", help="Change pairs as the adviser says.")] = False,
    realtime: Annotated[bool, typer.Option("--realtime", help="Wait for the clock with a file, too.")] = False,
    log: Annotated[Path | None, typer.Option(help="Write what happened to this CSV file.")] = None,
    backend: Backend = "auto",
) -> None:
    """Drive an arm by rates: the pair of coordinates that is chosen, at most six rates at a time, 50 times a second."""
    if keys == (rates is not None):
        raise RangeError("rates", rates, "give either --rates FILE or --keys")
    q = configuration_of(parts(robot).robot, at)
    source = RateFile(rates) if rates is not None else None
    session = Teleoperation(robot, mode or ("M1", "M2"), automatic=automatic, backend=backend)
    last = [""]

    def tell(time: float, seen: Seen) -> None:
        """A line when something changes."""
        text = f"{seen.active}{' (changing)' if seen.blending else ''}, {seen.step.status}"
        if text != last[0]:
            err().print(f"{time:8.2f} s  {escape(text)}", soft_wrap=True)
            last[0] = text

    if source is not None:
        found = run_session(session, source, q, realtime=realtime, tell=tell)
    else:
        err().print(HELP, soft_wrap=True)
        with Keyboard().terminal() as keyboard:
            found = run_session(session, keyboard, q, realtime=True, tell=tell)
    _report(found, session, log)


def _report(found: SessionLog, session: Teleoperation, log: Path | None) -> None:
    statuses = ", ".join(f"{found.status.count(s)} {s}" for s in dict.fromkeys(found.status))
    fastest = max((float(np.abs(v).max()) for v in found.v), default=0.0)
    changes = sum(a != b for a, b in zip(found.active, found.active[1:], strict=False))
    out().print(
        f"{len(found.time)} ticks: {statuses or 'none'}; fastest joint {fastest:.4g} rad/s, "
        f"{changes} changes of pairs, {found.late} late",
        soft_wrap=True,
    )
    if log is not None:
        out().print(escape(str(found.write(log, session.robot.dof_names))), soft_wrap=True)
