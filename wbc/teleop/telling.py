"""A session of manual control in words: where it begins, what changes while it goes, and what came of it."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np

from wbc.coordinates import Condition
from wbc.teleop.loop import SessionLog
from wbc.teleop.session import NOTHING, Seen, Teleoperation

#: Parts of a command between which losses are distinguished [1]
STEPS = (NOTHING, 0.01, 0.1, 0.5)
#: While only the loss changes, a line after so long [s]
PAUSE = 0.5


class Teller:
    """Says when something changes: pair, status, advice, or how much of the command is lost."""

    def __init__(self) -> None:
        self._last: tuple[object, ...] = ()
        self._loss, self._time = -1, -PAUSE

    def news(self, time: float, seen: Seen) -> str:
        """What is new at a time [s], as a line; "" for nothing."""
        state = seen.active, seen.blending, seen.step.status, seen.advised
        loss = sum(seen.lost > step for step in STEPS)
        if state == self._last and (loss == self._loss or time < self._time + PAUSE):
            return ""
        self._last, self._loss, self._time = state, loss, time
        text = f"{seen.active}{' (changing)' if seen.blending else ''}, {seen.step.status}, sigma {seen.sigma:.2g}"
        text += f" ({seen.kept:.2f} of the task's)"
        if seen.advised != seen.active:
            text += f", better: {seen.advised}"
        if seen.lost > NOTHING:
            text += f"; lost {100 * seen.lost:.2g} %: asked {_rates(seen.asked)}, met {_rates(seen.met)}"
        return f"{time:8.2f} s  {text}{': ' if seen.why else ''}{', '.join(seen.why)}"


def live_line(session: Teleoperation, q: Any, time: float, seen: Seen) -> str:
    """Pose of what is commanded at a configuration, its rate, and what binds."""
    parts, frame = [f"{time:7.1f} s"], getattr(session.control.pair.task, "frame", "")
    if frame in session.robot.frame_names:
        place = session.robot.pose(q, frame).translation
        parts.append(f"{frame} at ({', '.join(f'{x:.3f}' for x in place)}) m")
    binding = ", ".join(str(one) for one in seen.step.binding[:2])
    return "  ".join([*parts, f"rate {_rates(seen.met)}", f"binds: {binding}" if binding else "nothing binds"])


def start_warning(session: Teleoperation, q: Any) -> str:
    """Where the first pair is near the loss of its rank, with the better one; "" where it is not."""
    first = session.control.active
    here = next(one for one in session.adviser.advise(q) if one.pair == first)
    if here.condition is Condition.REGULAR:
        return ""
    what = "the task itself is" if here.condition is Condition.TASK else f"{first!r} is"
    better = session.adviser.recommend(q, first)
    hint = f"; better: {better!r}" if better != first else ""
    return f"this start is {min(here.distance, session.adviser.near):.2g} rad from where {what} singular{hint}"


def outcome(session: Teleoperation, found: SessionLog) -> list[str]:
    """Ticks, pairs and losses of a session, a line each."""
    status = found.status
    statuses = ", ".join(f"{status.count(s)} {s}" for s in dict.fromkeys(status))
    fastest = max((float(np.abs(v).max()) for v in found.v), default=0.0)
    changes = sum(a != b for a, b in pairwise(found.active))
    counts = f"{changes} changes of pairs, {found.late} late{', ended by Ctrl-C' if found.interrupted else ''}"
    lines = [f"{len(found.time)} ticks: {statuses or 'none'}; fastest joint {fastest:.4g} rad/s, {counts}"]
    ramps = sum(seen.ramping for seen in found.seen)
    late = f"late, and not lost, in {ramps} ticks while rates rise or fall" if ramps else ""
    if ticks := found.lost_in(STEPS[1]):
        worst = found.seen[ticks[0]]
        text = (
            f"lost: more than 1 % of the command in {len(ticks)} ticks, at most {100 * worst.lost:.2g} % "
            f"at {found.time[ticks[0]]:.2f} s with {worst.active}: {', '.join(worst.why)}; "
            f"{session.nearest_locus(found.q[ticks[0]], worst.active)}"
        )
        lines.append(f"{text}; {late}" if late else text)
    elif late:
        lines.append(f"nothing of the command was lost; it was {late}")
    return lines


def _rates(numbers: np.ndarray) -> str:
    return f"({', '.join(f'{x:.3g}' for x in numbers)})"
