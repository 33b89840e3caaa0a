"""A session run against a source of orders and a plant."""

from __future__ import annotations

import csv
import os
import pathlib
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from wbc import validation
from wbc.errors import RangeError, RobotFileError, ShapeError
from wbc.log import Log
from wbc.robot import Robot
from wbc.robot.robot import checked_robot
from wbc.simulation import Connection, Plant
from wbc.teleop.order import AT_ONCE, Source
from wbc.teleop.rate_file import COLUMNS
from wbc.teleop.session import NOTHING, RATE, Seen, Teleoperation
from wbc.tick.outcome import STATUSES
from wbc.validation import Array


@dataclass
class SessionLog:
    """What happened tick by tick.

    Attributes:
        time [s]. q: configurations before each tick. seen: what the operator was shown. late: ticks that began more
        than a period behind the clock. interrupted: ended by Ctrl-C. cost: processor time of each tick [s].
    """

    time: list[float] = field(default_factory=list)
    q: list[Array] = field(default_factory=list)
    seen: list[Seen] = field(default_factory=list)
    late: int = 0
    interrupted: bool = False
    cost: list[float] = field(default_factory=list)

    @property
    def v(self) -> list[Array]:
        """Commands [nv]."""
        return [one.step.v for one in self.seen]

    @property
    def active(self) -> list[str]:
        """Pairs in use."""
        return [one.active for one in self.seen]

    @property
    def status(self) -> list[str]:
        """How ticks ended."""
        return [str(one.step.status) for one in self.seen]

    @property
    def lost(self) -> list[float]:
        """Parts of the command that were lost, see :class:`Seen`."""
        return [one.lost for one in self.seen]

    def lost_in(self, part: float) -> list[int]:
        """Ticks in which more than a part of the command was lost, the worst first; ramps do not count.

        Raises:
            ShapeError, NotFiniteError: no number.
        """
        least = validation.scalar("part", part)
        ticks = [k for k, one in enumerate(self.seen) if one.lost > least and not one.ramping]
        return sorted(ticks, key=lambda k: -self.seen[k].lost)

    def add(self, time: float, q: Array, seen: Seen, cost: float = 0.0) -> None:
        """One tick."""
        self.time.append(time)
        self.q.append(q)
        self.seen.append(seen)
        self.cost.append(cost)

    def trim(self) -> None:
        """Leave out a tick that an interrupt has cut in two."""
        count = min(len(self.time), len(self.q), len(self.seen), len(self.cost))
        for some in (self.time, self.q, self.seen, self.cost):
            del some[count:]

    def write(self, path: str | os.PathLike[str], names: tuple[str, ...]) -> pathlib.Path:
        """As CSV: time, pair, status, sigma, kept, advised, lost, why, asked and met by row, q and v by joint.

        Raises:
            RobotFileError: it cannot be written.
        """
        file, names = validation.file_path("path", path), validation.strings("names", names)
        rows = range(1, AT_ONCE + 1)
        head = ["time", "pair", "status", "sigma", "kept", "advised", "lost", "why"]
        head += [*(f"asked {k}" for k in rows), *(f"met {k}" for k in rows)]
        with validation.writing("path", file, RobotFileError):
            file.parent.mkdir(parents=True, exist_ok=True)
            with file.open("w", newline="", encoding="utf-8") as out:
                table = csv.writer(out)
                coordinates = len(self.q[0]) if self.q else len(names)
                places = names if coordinates == len(names) else tuple(map(str, range(coordinates)))
                table.writerow([*head, *(f"q {n}" for n in places), *(f"v {n}" for n in names)])
                for time, q, seen in zip(self.time, self.q, self.seen, strict=True):
                    own = [f"{seen.sigma:.6g}", f"{seen.kept:.6g}", seen.advised, f"{seen.lost:.6g}"]
                    rates = (_padded(seen.asked), _padded(seen.met))
                    numbers = map(repr, [*q.tolist(), *seen.step.v.tolist()])
                    what = [f"{time:.6g}", seen.active, str(seen.step.status), *own, "; ".join(seen.why)]
                    table.writerow([*what, *rates[0], *rates[1], *numbers])
        return file

    def columns(self, robot: Robot) -> Log:
        """As the log of every run: ``t``, ``q.*``, ``v.*``, ``asked.*``, ``met.*`` (rows of the pair), ``sigma``,
        ``kept``, ``lost``, ``status``, ``tick``, and as flags ``binding.*``, ``pair.*`` and ``why.*``, what took of the
        command.
        """
        robot = checked_robot(robot)
        n, q = len(self.time), np.reshape(self.q, (-1, robot.nq))
        rates = np.zeros((n, 2, AT_ONCE))
        flags: dict[str, Array] = {}
        for k, seen in enumerate(self.seen):
            rates[k, 0, : len(seen.asked)], rates[k, 1, : len(seen.met)] = seen.asked, seen.met
            said = [f"binding.{row}" for row in seen.step.binding if row.bound != "equal"]
            said += [f"pair.{seen.active}", *(["pair.changing"] if seen.blending else [])]
            for name in [*said, *(f"why.{reason}" for reason in (seen.why if seen.lost > NOTHING else ()))]:
                flags.setdefault(name, np.zeros(n, dtype=bool))[k] = True
        names = robot.dof_names if robot.nq == robot.nv else tuple(map(str, range(robot.nq)))
        columns = {"t": np.array(self.time)} | {f"q.{name}": q[:, k] for k, name in enumerate(names)}
        columns |= {f"v.{name}": np.reshape(self.v, (-1, robot.nv))[:, k] for k, name in enumerate(robot.dof_names)}
        columns |= {f"{what}.{k}": rates[:, j, k] for j, what in enumerate(("asked", "met")) for k in range(AT_ONCE)}
        columns |= {name: np.array([getattr(one, name) for one in self.seen]) for name in ("sigma", "kept", "lost")}
        columns["status"] = np.array([STATUSES.index(one.step.ended) for one in self.seen], dtype=np.int8)
        columns |= {"tick": np.array(self.cost), **flags}
        units = dict.fromkeys(columns, "") | {"t": "s", "tick": "s"}
        units |= {f"v.{name}": f"{unit}/s" for name, unit in zip(robot.dof_names, robot.dof_units, strict=True)}
        if robot.nq == robot.nv:
            units |= {f"q.{name}": unit for name, unit in zip(names, robot.dof_units, strict=True)}
        meta = {"robot": robot.name, "ticks": n, "late": self.late, "interrupted": self.interrupted}
        return Log(columns, units, meta)

    def save_orders(self, path: str | os.PathLike[str]) -> pathlib.Path:
        """As a :class:`RateFile`: what was commanded from tick to tick, on the pairs that were used.

        From the same configuration a session with the same pairs does the same again, changes of pairs by an adviser
        included.

        Raises:
            RangeError: nothing was done. RobotFileError: it cannot be written.
        """
        file = validation.file_path("path", path)
        if not self.time:
            raise RangeError("log", self, "there are no ticks to save")
        lines: list[list[str]] = []
        for at, seen in zip(self.time, self.seen, strict=True):
            said = [seen.active, *map(repr, seen.asked.tolist())]
            if not lines or said != lines[-1][1:]:
                lines.append([repr(at), *said])
        with validation.writing("path", file, RobotFileError):
            file.parent.mkdir(parents=True, exist_ok=True)
            with file.open("w", newline="", encoding="utf-8") as out:
                csv.writer(out).writerows([COLUMNS, *lines, [repr(self.time[-1] + 1.0 / RATE)]])
        return file


def _padded(rates: Array) -> list[str]:
    """One cell for each of the rates that there can be."""
    given = [f"{x:.9g}" for x in rates.tolist()]
    return given + [""] * (AT_ONCE - len(given))


def run_session(
    session: Teleoperation,
    source: Source,
    q: Any,
    *,
    seconds: float = np.inf,
    realtime: bool = False,
    progress: Callable[[float, Seen], None] | None = None,
    log: SessionLog | None = None,
    plant: Plant | None = None,
) -> SessionLog:
    """Orders from a source until it ends, for some seconds, or until Ctrl-C.

    Args:
        realtime: wait for the clock, 50 ticks a second; else as fast as it goes.
        progress: called after every tick with its time and what was seen.
        log: written tick by tick, so that it has what there was when an error ends the run; default: a new one.
        plant: what moves; default: a :class:`wbc.simulation.KinematicPlant`, which does exactly what it is commanded.

    Raises:
        WbcError: a bad order or configuration, or what :class:`wbc.simulation.Connection` raises of the plant. The
            plant and the session are at rest then, and the session can be reset.
    """
    validation.instance("session", session, Teleoperation, "a Teleoperation")
    if not callable(getattr(source, "order", None)):
        raise ShapeError("source", source, "expected a source of orders: RateFile, Keyboard, ...")
    if log is not None:
        validation.instance("log", log, SessionLog, "a SessionLog")
    validation.function("progress", progress)
    realtime = validation.flag("realtime", realtime)
    q, log = session.robot.configuration("q", q), SessionLog() if log is None else log
    limit = validation.real_array("seconds", seconds, (), finite=False)
    connection = Connection(plant, session.robot, session.control.dt)
    session.reset(q)
    q = connection.reset(q).q
    try:
        with connection:
            _run(session, source, q, connection, limit=float(limit), realtime=realtime, progress=progress, log=log)
    except KeyboardInterrupt:
        log.interrupted = True
    finally:
        log.trim()
    return log


def _run(
    session: Teleoperation,
    source: Source,
    q: Array,
    connection: Connection,
    *,
    limit: float,
    realtime: bool,
    progress: Callable[[float, Seen], None] | None,
    log: SessionLog,
) -> None:
    period, began, tick = session.control.dt, time.monotonic(), 0
    while tick * period < limit:
        now = tick * period
        if realtime:
            wait = began + now - time.monotonic()
            log.late += wait < -period
            time.sleep(max(0.0, wait))
        try:
            order = source.order(now, session.names, session.control.active, session.units)
        except StopIteration:
            return
        before = time.thread_time()
        seen = session.step(q, order)
        log.add(now, q, seen, time.thread_time() - before)
        if progress is not None:
            validation.called("progress", progress, now, seen)
        q = connection.drive(seen.step.v).q
        tick += 1
