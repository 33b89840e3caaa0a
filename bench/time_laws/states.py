"""From state to state: raw ruckig and ours on many random states, straight moves, and moves beside walls."""

from __future__ import annotations

import multiprocessing
import signal
from collections.abc import Iterator
from typing import Any

import numpy as np

from bench.time_laws import raw
from tests.trajectory.random_motions import FAMILIES, drawn, misses
from wbc.errors import BoundsError
from wbc.trajectory import jerk_limited
from wbc.trajectory.jerk.braking import reach
from wbc.validation import Array

Record = dict[str, Any]

#: States of a record
CHUNK = 500
#: Moves whose joints leave the straight line by more than this share of its length are not straight
BENT = 1e-6


def chunks(count: int) -> int:
    """Records for so many states, each family having the same number of them."""
    return len(FAMILIES) * max(1, round(count / CHUNK / len(FAMILIES)))


def random_states(seed: int, count: int, processes: int) -> Iterator[Record]:
    """Counts for a chunk of states of one family at a time."""
    size = min(CHUNK, max(1, count // len(FAMILIES)))
    work = [(FAMILIES[k % len(FAMILIES)], seed, k, size) for k in range(chunks(count))]
    if processes == 1:
        yield from map(chunk, work)
        return
    with multiprocessing.get_context("spawn").Pool(processes, _deaf) as pool:
        yield from pool.imap_unordered(chunk, work)


def _deaf() -> None:
    """Ctrl-C is for the process that counts."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)


def chunk(work: tuple[str, int, int, int]) -> Record:
    """What both do with ``size`` states of a family; states depend on the seed and the number of the chunk only."""
    family, seed, number, size = work
    rng = np.random.default_rng([seed, number])
    asked = [drawn(family, rng) for _ in range(size)]
    refused = sum(raw.calculate(raw.state_to_state(a)) is None for a in asked)
    laws, kept, errors = [], [], []
    for arguments in asked:
        try:
            laws.append(jerk_limited(**arguments))
        except Exception as error:  # noqa: BLE001 (every exception counts, whatever it is)
            errors.append(f"{type(error).__name__}: {error}")
        else:
            kept.append(arguments)
    excess, off = misses(laws, kept) if laws else (0.0, 0.0)
    return {
        "family": family, "states": size, "raw": refused, "ours": len(errors), "excess": excess, "off": off,
        "errors": errors[:3],
    }  # fmt: skip


def straight_moves(rng: np.random.Generator, count: int) -> Iterator[Record]:
    """Moves of 7 joints from rest to rest, with limits of their own for each: how far they leave the line."""
    for _ in range(count):
        start, target = rng.uniform(-2.0, 2.0, (2, 7))
        names = (("velocity", 0.5, 3.0), ("acceleration", 2.0, 10.0), ("jerk", 20.0, 150.0))
        asked = {name: rng.uniform(low, high, 7) for name, low, high in names}
        theirs = raw.calculate(raw.state_to_state({"start": start, "target": target, **asked}, "Phase"))
        phase = [theirs.at_time(t)[0] for t in np.linspace(0.0, theirs.duration, 201)]
        law = jerk_limited(start, target, **asked, straight=True)
        ours = law.at(np.linspace(0.0, law.duration, 201)).position
        yield {
            "raw": _bend(np.array(phase), start, target),
            "ours": _bend(ours, start, target),
            "longer": law.duration / theirs.duration - 1.0,
            "kept": law.certificate.satisfied,
        }


def _bend(places: Array, start: Array, target: Array) -> float:
    """Largest distance from the line as a share of its length."""
    length = float(np.linalg.norm(target - start))
    way = (target - start) / length
    across = (places - start) - np.outer((places - start) @ way, way)
    return float(np.linalg.norm(across, axis=1).max()) / length


def walls(rng: np.random.Generator, count: int) -> Iterator[Record]:
    """Moves of 3 joints between two states in motion, with position limits of 1 rad to either side.

    ``able``: from the start every joint can stop within the limits, and to the target it can come from rest in them.
    """
    for _ in range(count):
        states = rng.uniform(-1.0, 1.0, (2, 3, 3)) * np.array([1.0, 2.0, 3.0])[:, None]
        sizes = {"velocity": np.full(3, 3.0), "acceleration": np.full(3, 10.0), "jerk": np.full(3, 100.0)}
        names = [end + part for end in ("start", "target") for part in ("", "_velocity", "_acceleration")]
        asked = {**dict(zip(names, states.reshape(6, 3), strict=True)), **sizes}
        extrema = raw.calculate(raw.state_to_state(asked)).position_extrema
        beyond = max(max(e.max - 1.0, -1.0 - e.min) for e in extrema)
        # Backwards in time, a way to a target is a stop with the other speed
        record = {"raw": beyond, "able": _can_stop(states[0], 1.0) and _can_stop(states[1], -1.0)}
        try:
            law = jerk_limited(**asked, lower=-1.0, upper=1.0)
        except BoundsError:
            yield record | {"ours": None}
            continue
        yield record | {"ours": law.certificate.worst["position"].ratio - 1.0}


def _can_stop(state: Array, sign: float) -> bool:
    """Whether joints can stop between -1 and 1."""
    place, speed, push = state
    ways = np.array([reach(sign * v, a, 10.0, 100.0) for v, a in zip(speed.tolist(), push.tolist(), strict=True)])
    return bool((place + ways[:, 0] >= -1.0).all() and (place + ways[:, 1] <= 1.0).all())
