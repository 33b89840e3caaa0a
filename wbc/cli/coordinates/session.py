"""A session of ``wbc coordinates drive``: driven, told while it goes, and written."""

from __future__ import annotations

import contextlib
from pathlib import Path

from wbc.cli.console import err, say, tell
from wbc.cli.coordinates.asked import DriveAsked
from wbc.cli.folders import filled, recording, run_folder
from wbc.cli.output import RECORDED
from wbc.cli.scene import configuration
from wbc.cli.session import INTERRUPTED
from wbc.coordinates import parts
from wbc.errors import RangeError, UnknownNameError
from wbc.extras import MissingPackageError
from wbc.log import save
from wbc.robot import Robot
from wbc.robots import load
from wbc.teleop import Keyboard, RateFile, Seen, SessionLog, Teleoperation, run_session
from wbc.teleop.keyboard import HELP
from wbc.teleop.telling import Teller, live_line, outcome, start_warning

#: Table of a session's ticks
LOG = "log.csv"
#: The page on which it is played
REPLAY = "replay.html"
WRITTEN = (LOG, "log.npz", "report.html", REPLAY)
#: The live line is written anew after so long [s]
LIVE = 0.1


def driven(asked: DriveAsked) -> int:
    """Drives, from the first configuration until the orders end; the exit code."""
    if asked.keys == (asked.rates is not None):
        raise RangeError("rates", asked.rates, "give either --rates FILE or --keys")
    if asked.mcap and asked.out is None:
        raise RangeError("mcap", True, "it goes into the folder of --out")
    folder = None if asked.out is None else run_folder(asked.out, "drive", (*WRITTEN, *RECORDED), asked.force)
    machine = _standing(asked.robot)
    given = configuration(parts(machine).robot, "at", asked.at) if asked.at else None
    source = RateFile(asked.rates) if asked.rates is not None else None
    tell(f"starting {asked.robot} ...")
    session = Teleoperation(
        machine, list(asked.mode) or None, automatic=asked.automatic, scaled=asked.scaled, backend=asked.backend
    )
    q = session.start() if given is None else given
    if given is None:
        tell(f"from --at={','.join(f'{x:.4f}' for x in q)}")
    if warning := start_warning(session, q):
        tell(f"warning: {warning}")
    found = SessionLog()
    try:
        with contextlib.ExitStack() as stack, _Line(session, found) as line:
            if folder is not None and (record := recording(stack, folder, asked.mcap)) is not None:
                record(session.control.controller)
            if source is not None:
                run_session(session, source, q, realtime=asked.realtime, progress=line.told, log=found)
            else:
                tell(HELP)
                with Keyboard().terminal() as keyboard:
                    run_session(session, keyboard, q, realtime=True, progress=line.lived, log=found)
    finally:
        for text in outcome(session, found):
            say(text)
        if asked.log is not None:
            say(found.write(asked.log, session.robot.dof_names))
        if asked.teach is not None and found.time:
            start = ",".join(repr(x) for x in found.q[0].tolist())
            again = f"again: wbc coordinates drive {asked.robot} --rates {found.save_orders(asked.teach)} --at={start}"
            say(again + "".join(f" --mode {one}" for one in asked.mode))
        if folder is not None:
            say(f"{folder}: {', '.join(_pages(found, session, folder))}")
    return INTERRUPTED if found.interrupted else 0


def _pages(found: SessionLog, session: Teleoperation, folder: Path) -> list[str]:
    """Names of the files of a session's folder."""
    from wbc.teleop.report import save_report
    from wbc.viewer.errors import ViewerError
    from wbc.viewer.runs import save_motion

    with filled(folder) as fresh:
        found.write(fresh / LOG, session.robot.dof_names)
        save(found.columns(session.robot), fresh, "npz")
        # A session is worth keeping where what draws the page is not installed, and without a tick there is none
        with contextlib.suppress(ViewerError, MissingPackageError):
            save_motion(session.robot, found.time, found.q, fresh / REPLAY)
        save_report(session, found, fresh)
    return [name for name in (*WRITTEN, *RECORDED) if (folder / name).is_file()]


def _standing(name: str) -> str | Robot:
    """What is driven: a robot that floats, such as a humanoid, with its base held."""
    try:
        base = load(name, shapes="none").base
    except UnknownNameError:
        return name
    if base != "floating":
        return name
    tell(f"{name} floats: its base is held where it is")
    return load(name, base="fixed")


class _Line:
    """News as lines; below them, at a terminal while keys are pressed, one that is written anew."""

    def __init__(self, session: Teleoperation, found: SessionLog) -> None:
        self._session, self._found, self._teller, self._console = session, found, Teller(), err()
        self._after = -LIVE

    def __enter__(self) -> _Line:
        return self

    def __exit__(self, *_: object) -> None:
        self._write("")

    def _write(self, text: str) -> None:
        if self._console.is_terminal:
            self._console.file.write("\r\x1b[K" + text[: self._console.width - 1])
            self._console.file.flush()

    def told(self, time: float, seen: Seen) -> None:
        if text := self._teller.news(time, seen):
            tell(text)

    def lived(self, time: float, seen: Seen) -> None:
        """News, and the last line."""
        if text := self._teller.news(time, seen):
            self._write("")
            tell(text)
        if self._console.is_terminal and time >= self._after + LIVE:
            self._after = time
            self._write(live_line(self._session, self._found.q[-1], time, seen))
