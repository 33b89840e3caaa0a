"""A session run against a source of orders, with a robot that follows its commands."""

from __future__ import annotations

import csv
import os
import pathlib
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pinocchio as pin

from wbc import validation
from wbc.errors import RobotFileError
from wbc.teleop.order import Source
from wbc.teleop.session import Seen, Teleoperation
from wbc.validation import Array


@dataclass
class SessionLog:
    """What happened tick by tick.

    Attributes:
        time [s]. q: configurations before each tick. v: commands. active: pairs. status: how ticks ended.
        late: ticks that began more than a period behind the clock.
    """

    time: list[float] = field(default_factory=list)
    q: list[Array] = field(default_factory=list)
    v: list[Array] = field(default_factory=list)
    active: list[str] = field(default_factory=list)
    status: list[str] = field(default_factory=list)
    late: int = 0

    def add(self, time: float, q: Array, seen: Seen) -> None:
        """One tick."""
        self.time.append(time)
        self.q.append(q)
        self.v.append(seen.step.v.copy())
        self.active.append(seen.active)
        self.status.append(str(seen.step.status))

    def write(self, path: str | os.PathLike[str], names: tuple[str, ...]) -> pathlib.Path:
        """As CSV: time, pair, status, q and v by joint.

        Raises:
            RobotFileError: it cannot be written.
        """
        file = pathlib.Path(path)
        try:
            file.parent.mkdir(parents=True, exist_ok=True)
            with file.open("w", newline="", encoding="utf-8") as out:
                table = csv.writer(out)
                table.writerow(["time", "pair", "status", *(f"q {n}" for n in names), *(f"v {n}" for n in names)])
                for row in zip(self.time, self.active, self.status, self.q, self.v, strict=True):
                    table.writerow([f"{row[0]:.6g}", row[1], row[2], *map(repr, [*row[3].tolist(), *row[4].tolist()])])
        except OSError as error:
            raise RobotFileError("path", str(file), f"cannot be written: {error.strerror}") from error
        return file


def run_session(
    session: Teleoperation,
    source: Source,
    q: Any,
    *,
    seconds: float = np.inf,
    realtime: bool = False,
    tell: Callable[[float, Seen], None] | None = None,
) -> SessionLog:
    """Orders from a source until it ends, or for some seconds; the robot follows its commands exactly.

    Args:
        realtime: wait for the clock, 50 ticks a second; else as fast as it goes.
        tell: called after every tick with its time and what was seen.

    Raises:
        WbcError: a bad order or configuration; the session is at rest then and can be reset.
    """
    q, log = session.robot.configuration("q", q), SessionLog()
    limit = validation.real_array("seconds", seconds, (), finite=False)
    session.reset(q)
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
            break
        seen = session.step(q, order)
        log.add(now, q, seen)
        if tell is not None:
            tell(now, seen)
        q = pin.integrate(session.robot.model, q, period * seen.step.v)
        tick += 1
    return log
