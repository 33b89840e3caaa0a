"""From state to state: raw ruckig and ours on many random states."""

from __future__ import annotations

import multiprocessing
import signal
from collections.abc import Iterator
from typing import Any

import numpy as np

from bench.time_laws import raw
from tests.trajectory.random_motions import FAMILIES, drawn, misses
from wbc.trajectory import jerk_limited

Record = dict[str, Any]

#: States of a record
CHUNK = 500


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
    laws, kept = [], []
    for arguments in asked:
        try:
            laws.append(jerk_limited(**arguments))
        except Exception:  # noqa: BLE001 (every exception counts, whatever it is)
            continue
        kept.append(arguments)
    excess, off = misses(laws, kept) if laws else (0.0, 0.0)
    return {
        "family": family, "states": size, "raw": refused, "ours": size - len(laws), "excess": excess, "off": off,
    }  # fmt: skip
