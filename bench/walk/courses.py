"""Walks along the published courses and turns on the spot, and how fast they can be."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from math import ceil, pi

from bench.walk.machine import INCH, KEPT, Job, Machine, Record
from wbc.walking.body_path import BodyPath, grid_path

#: E1a to E1d of the source with their reverses, and the other diagonal: from and to in (T, A)
COURSES: dict[str, tuple[tuple[float, float], tuple[float, float]]] = {
    "+A": ((13, 6), (13, 18)),
    "-A": ((13, 18), (13, 6)),
    "+T": ((6, 12), (19, 12)),
    "-T": ((19, 12), (6, 12)),
    "+T +A": ((6, 6), (14.37, 18)),
    "-T -A": ((14.37, 18), (6, 6)),
    "+T -A": ((6, 18), (14.37, 6)),
    "-T +A": ((14.37, 6), (6, 18)),
}
#: Speed of the courses [in/s], rate of the turns [rad/s]
SPEED, RATE = 6.0, 0.15
#: So often each course is walked for its times; all else is the same each time
REPEATS = 3
#: The highest that are looked for, and how closely
FASTEST, CLOSE = 12.0, 0.1
FASTEST_TURN, CLOSE_TURN = 0.3, 0.005
#: The least that are tried, as a part of the usual
LEAST = 0.05


def course(it: Machine, name: str, speed: float) -> Record:
    """One course at a speed [in/s]."""
    return _moving(it, grid_path(COURSES[name], speed * INCH)) | {"course": name, "asked": speed}


def spin(it: Machine, rate: float, angle: float = 6 * pi) -> Record:
    """A turn by an angle [rad] on the spot over (13, 12), at a rate [rad/s]."""
    count = ceil(angle / (pi / 2) - 1e-9)
    places = [(13.0, 12.0, k * angle / count) for k in range(count + 1)]
    record = it.walk(it.structure, grid_path(places, 1.0, rate))
    if record["planned"]:
        record["kept"] = record["turn_rate"] / record["asked_turn_rate"]
    return record | {"course": f"{angle / (2 * pi):g} turns", "asked": rate}


def highest(walk: Callable[[float], Record], usual: float, fastest: float, close: float) -> Record:
    """By bisection the highest speed that is kept, and what a faster walk lacks; the usual one is tried first."""
    low, high, why, best = 0.0, fastest, "", dict[str, object]()
    asked, tried = usual, 0
    while high - low > close + 1e-9 and asked > LEAST * usual:
        found = walk(asked)
        tried += 1
        if keeps(found):
            low, best = asked, found
        else:
            high, why = asked, binding(found)
        asked = round((low + high) / 2, 4) if low else high / 2
    return {**best, "highest": low, "above": high, "limit": why, "tried": tried}


def keeps(record: Record) -> bool:
    """It arrived, as fast as it was asked to, and the checker finds nothing."""
    return bool(record.get("arrived") and record["kept"] >= KEPT and not record["violations"])


def binding(record: Record) -> str:
    """What a walk that does not keep its speed lacks."""
    if not record["planned"] or not record.get("arrived"):
        return str(record["reason"])
    if record["violations"]:
        return "; ".join(record["violations"])
    return f"{record['kept']:.3f} of the speed: hands land later than planned"


def course_jobs(it: Machine) -> list[Job]:
    """The eight at 6 in/s, each the one with the median time of :data:`REPEATS`."""

    def median(name: str) -> Record:
        found = [course(it, name, SPEED) for _ in range(REPEATS)]
        return sorted(found, key=lambda one: one.get("real_time_planned", 0.0))[REPEATS // 2]

    return [Job(name, partial(median, name)) for name in COURSES]


def highest_jobs(it: Machine) -> list[Job]:
    """For each course the highest speed."""

    def of(name: str) -> Record:
        found = highest(partial(course, it, name), SPEED, FASTEST, CLOSE)
        return found | {"course": name}

    return [Job(name, partial(of, name)) for name in COURSES]


def spin_jobs(it: Machine) -> list[Job]:
    """Three turns at 0.15 rad/s, and at the highest rate that is kept."""

    def most() -> Record:
        return highest(partial(spin, it), RATE, FASTEST_TURN, CLOSE_TURN) | {"course": "3 turns"}

    return [Job(f"{RATE:g} rad/s", partial(spin, it, RATE)), Job("highest", most)]


def _moving(it: Machine, path: BodyPath) -> Record:
    record = it.walk(it.structure, path)
    if record["planned"]:
        record["kept"] = record["speed"] / record["asked_speed"]
    return record
