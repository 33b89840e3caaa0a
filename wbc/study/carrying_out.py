"""Trials that are not done yet, carried out here or by the workers of a Dask cluster."""

from __future__ import annotations

import os
import traceback
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

from wbc import extras, validation
from wbc.cores import cores
from wbc.errors import SolverError, WbcError
from wbc.study.declaration import Study
from wbc.study.kept import Done, Kept
from wbc.study.scenario import Scenario, StudyTrial

#: Trials that a cluster has at a time, for each of its threads
AHEAD = 4
#: How long a cluster may take until it answers [s]
PATIENCE = 30
#: Lost workers that a trial survives
LOSSES = 3


@dataclass
class Progress:
    """Counts of a run: all trials, those that were done before it, those done now, and those that failed."""

    total: int
    before: int = 0
    done: int = 0
    failed: int = 0


def carry_out(
    kept: Kept,
    *,
    workers: int | None = None,
    address: str | None = None,
    tick: Callable[[Progress], object] = lambda _: None,
) -> Progress:
    """Carry out the trials of a study that are not done; those that failed are tried again.

    Each is kept when it ends. A trial that raises is kept as failed, with the reason, and the study goes on.

    Args:
        workers: processes of a cluster on this machine; None: none, all is done in this process.
        address: of the scheduler of any Dask cluster, whose workers have this package.
        tick: called after each trial.

    Raises:
        SolverError: no Dask, or no such cluster; RangeError: a bad number of workers. KeyboardInterrupt: what had ended
            until then is kept.
    """
    study: Study = kept.study
    missing = [trial for trial in study.trials() if (done := kept.get(trial)) is None or done.error]
    progress = Progress(study.count, before=study.count - len(missing))
    tick(progress)
    if workers is not None and address is not None:
        raise SolverError("workers", workers, "a cluster has an address or is made here, not both")
    if not missing:
        return progress
    if workers is None and address is None:
        found = _here(study, missing)
    else:
        found = _on_cluster(study, missing, workers, address)
    for trial, done in found:
        kept.put(trial, done)
        progress.done += 1
        progress.failed += bool(done.error)
        tick(progress)
    return progress


def perform(scenario: Scenario, trial: StudyTrial, metrics: tuple[str, ...], threads: int) -> Done:
    """One trial; an error in it is its result."""
    try:
        return Done(scenario.run(trial, metrics, threads))
    except WbcError as error:
        return Done({}, f"{type(error).__name__}: {error}")
    except Exception as error:  # noqa: BLE001 - a user's function may raise anything, and the other trials go on
        last = traceback.extract_tb(error.__traceback__)[-1]
        return Done({}, f"{type(error).__name__}: {error} ({os.path.basename(last.filename)}:{last.lineno})")


def _here(study: Study, trials: list[StudyTrial]) -> Iterator[tuple[StudyTrial, Done]]:
    threads = cores()
    for trial in trials:
        yield trial, perform(study.scenario, trial, study.metrics, threads)


def _on_cluster(
    study: Study, trials: list[StudyTrial], workers: int | None, address: str | None
) -> Iterator[tuple[StudyTrial, Done]]:
    """In the order in which they end. A trial whose worker is lost is done by another one."""
    waiting = iter(trials)
    with connected(workers, address) as client:
        from distributed import CancelledError, as_completed
        from distributed.client import ClosedClientError

        running: dict[Any, StudyTrial] = {}
        ended = as_completed()

        def submit() -> None:
            if (trial := next(waiting, None)) is not None:
                future = client.submit(perform, study.scenario, trial, study.metrics, 1, pure=False)
                running[future] = trial
                ended.add(future)

        try:
            for _ in range(AHEAD * max(1, sum(client.nthreads().values()))):
                submit()
            for future in ended:
                # A worker that dies takes results with it, which another one computes again
                if future.status in ("lost", "pending"):
                    ended.add(future)
                    continue
                trial, done = running.pop(future), _done(future)
                submit()
                yield trial, done
        except (CancelledError, ClosedClientError, OSError) as error:
            raise SolverError("address", address, f"the scheduler was lost: {error}") from error


def _done(future: Any) -> Done:
    """What came of a trial on a cluster, or why no worker could bring it to its end."""
    try:
        done: Done = future.result()
    except Exception as error:
        if future.status != "error":
            raise
        done = Done({}, f"{type(error).__name__}: {error}")
    return done


@contextmanager
def connected(workers: int | None, address: str | None) -> Iterator[Any]:
    """A client of a cluster, which is made and ended where no address is given."""
    extras.require("cluster", "a study on several workers")
    import dask
    import distributed

    settings = {
        "distributed.scheduler.allowed-failures": LOSSES,
        # Lost workers are expected, and the counts say what came of it
        "logging.distributed": "critical",
        "distributed.comm.timeouts.connect": f"{PATIENCE}s",
    }
    with dask.config.set(settings):
        if address is not None:
            try:
                client = distributed.Client(address, timeout=PATIENCE)
            except (OSError, ValueError) as error:
                raise SolverError("address", address, f"no scheduler answers there: {error}") from error
            with client:
                yield client
            return
        count = validation.integer("workers", workers, 1, 1024)
        made = distributed.LocalCluster(n_workers=count, threads_per_worker=1, dashboard_address=None)
        with made as cluster, distributed.Client(cluster) as client:
            # A worker that is killed while it starts, or that is not back in 15 s, would be given up for good
            cluster.adapt(minimum=count, maximum=count)
            yield client
