"""What a soak does, cut into jobs that can run in any order, in any process, and be kept in a file."""

from __future__ import annotations

import json
import logging
import warnings
from collections import Counter
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor, as_completed
from functools import partial
from multiprocessing import get_context
from pathlib import Path

from rich.progress import Progress

from bench import kept
from bench.kept import sources
from bench.records import Parts
from bench.soak.both import both
from bench.soak.episodes import stack
from bench.soak.faults import lost_library, one_iteration, plants
from bench.soak.known import problems
from bench.soak.surface import calls
from bench.soak.torques import torques

#: Names of runs with their counts
Found = list[tuple[str, Counter[str]]]
#: () -> what was found
Job = partial[Found]


def parts_of(seed: int, sizes: dict[str, int], native: bool) -> dict[str, list[Job]]:
    """Part -> its jobs."""
    n = sizes
    backends = ("vm", "native") if native else ("vm",)
    broken = [partial(job, seed, k, b) for b in backends for k in range(n["faults"]) for job in (one_iteration, plants)]
    if native:
        broken += [partial(lost_library, seed, k, harm) for k, harm in enumerate(("delete", "corrupt"))]
    out = {
        f"known {seed}": [partial(problems, seed, k, "vm", n["problems"]) for k in range(n["known"])],
        f"faults {seed}": broken,
    }
    for b in backends:
        out[f"{b} {seed}"] = [partial(stack, seed, k, b, n[f"{b} ticks"]) for k in range(n[b])]
    for b in backends:
        ticks, name = n["levels ticks"] * (10 if b == "native" else 1), f"levels {b} {seed}"
        out[name] = [partial(stack, seed, k, b, ticks, levels=True) for k in range(n["levels"])]
    if native:
        out[f"both {seed}"] = [
            partial(both, seed, k, n["both ticks"], levels=levels) for levels in (False, True) for k in range(n["both"])
        ]
    for b in backends:
        ticks = n["torque ticks"] * (200 if b == "native" else 1)
        out[f"torque {b} {seed}"] = [partial(torques, seed, k, b, ticks) for k in range(n["torque"])]
    out[f"calls {seed}"] = [partial(calls, seed, k, n["call rounds"]) for k in range(n["calls"])]
    return out


def key(job: Job) -> str:
    """The same for the same job."""
    return json.dumps([job.func.__name__, job.args, job.keywords])


class Kept:
    """Jobs that are done, see :class:`bench.kept.Kept`.

    Raises:
        ValueError: the file belongs to other sources.
    """

    def __init__(self, path: Path | None) -> None:
        version = {"sources": sources(("wbc", "tasks", "robots", "bench/soak"))} if path else {}
        self._kept = kept.Kept(path, version)

    def get(self, job: Job) -> Found | None:
        """What a job that is done found."""
        done = self._kept.get(key(job))
        return None if done is None else [(name, Counter(counts)) for name, counts in done]

    def put(self, job: Job, found: Found) -> None:
        """Keep it."""
        self._kept.put(key(job), found)


def measure(work: dict[str, list[Job]], known: Kept, processes: int, progress: Progress) -> tuple[Parts, str | None]:
    """(records of every part, the part in which Ctrl-C came)."""
    parts: Parts = {}
    name = "nothing"
    pool = ProcessPoolExecutor(processes, get_context("spawn"), _begin) if processes > 1 else None
    try:
        for name, jobs in work.items():
            records = parts[name] = []
            bar = progress.add_task(name, total=len(jobs))
            for found in _each(jobs, known, pool):
                records += [{"name": run, "counts": counts} for run, counts in found]
                progress.advance(bar)
    except KeyboardInterrupt:
        return parts, name
    finally:
        if pool is not None:
            pool.shutdown(cancel_futures=True)
    return parts, None


def _each(jobs: list[Job], known: Kept, pool: ProcessPoolExecutor | None) -> Iterator[Found]:
    """What every job finds; those that are kept first."""
    done = [known.get(job) for job in jobs]
    yield from (found for found in done if found is not None)
    open_jobs = [job for job, found in zip(jobs, done, strict=True) if found is None]
    for job, found in _run(open_jobs, pool):
        known.put(job, found)
        yield found


def _run(jobs: list[Job], pool: ProcessPoolExecutor | None) -> Iterator[tuple[Job, Found]]:
    """Jobs as they end."""
    if pool is None:
        yield from ((job, _alone(job)) for job in jobs)
        return
    waiting = {pool.submit(job): job for job in jobs}
    for future in as_completed(waiting):
        yield waiting[future], future.result()


def _alone(job: Job) -> Found:
    """In this process, whose log and warnings are as before afterwards."""
    logger = logging.getLogger("wbc")
    level = logger.level
    try:
        with warnings.catch_warnings():
            _begin()
            return job()
    finally:
        logger.setLevel(level)


def _begin() -> None:
    """Of a process: targets at 50 m and weights of 1e3 overflow inside NumPy now and then; what comes out is judged."""
    logging.getLogger("wbc").setLevel(logging.ERROR)
    warnings.simplefilter("ignore", RuntimeWarning)
