"""Many clips: found in folders, retargeted one by one or in parallel processes, each kept when it is done."""

from __future__ import annotations

import contextlib
import functools
import json
import multiprocessing
import os
import pathlib
import shutil
import signal
import time
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from wbc import robots, validation
from wbc.errors import ClipFileError, WbcError
from wbc.retarget.report import write_report
from wbc.retarget.sources.loading import CLIP_SUFFIXES, load_clip

if TYPE_CHECKING:
    from wbc.retarget.retargeter import Retargeter

#: The file that a finished clip has
DONE = "report.json"


@dataclass(frozen=True)
class ClipJob:
    """A clip, and what is made of it.

    Attributes:
        clip: its file. folder: that its motion and report are written into.
        robot: name or file. loading: options of :func:`~wbc.retarget.load_clip`.
        options: fields of ``RetargetOptions`` that are not at their defaults.
        formats: of the motion, besides npz. film: whether one is drawn.
        support: whether the report says in how many frames contacts and motors hold the robot at rest.
        correspondence: file of :meth:`~wbc.retarget.Correspondence.save` that corrects what is found.
    """

    clip: pathlib.Path
    folder: pathlib.Path
    robot: str
    loading: Mapping[str, Any] = field(default_factory=dict)
    options: Mapping[str, Any] = field(default_factory=dict)
    formats: tuple[str, ...] = ()
    film: bool = True
    support: bool = False
    correspondence: pathlib.Path | None = None

    @property
    def asked(self) -> dict[str, Any]:
        """What a finished clip must have been asked for to be left as it is: plain data."""
        plain: dict[str, Any] = {name: getattr(self, name) for name in ("robot", "loading", "options", "formats")}
        plain |= {"support": True} if self.support else {}
        file = self.correspondence
        plain |= {} if file is None else {"correspondence": file.read_text(encoding="utf-8")}
        return dict(json.loads(json.dumps(plain, default=str, sort_keys=True)))

    @property
    def is_done(self) -> bool:
        """Whether its folder has what is asked for."""
        try:
            done = json.loads((self.folder / DONE).read_text(encoding="utf-8"))
        except (OSError, ValueError):
            return False
        return isinstance(done, dict) and done.get("asked") == self.asked


@dataclass(frozen=True)
class ClipDone:
    """What came of a clip: figures of its report, or the reason why there are none."""

    job: ClipJob
    figures: Mapping[str, Any]
    reason: str = ""


def find_clips(paths: Sequence[str | os.PathLike[str]]) -> list[tuple[pathlib.Path, pathlib.Path]]:
    """Files of clips, and of folders all clips in them, with the path that each has in a folder of results.

    Raises:
        ClipFileError: no such file or folder, or a folder without a clip.
    """
    out: list[tuple[pathlib.Path, pathlib.Path]] = []
    taken = Counter[pathlib.Path]()
    for given in paths:
        path = validation.existing("clip", given, ClipFileError)
        below = [file for file in path.rglob("*") if file.suffix.lower() in CLIP_SUFFIXES and file.is_file()]
        if path.is_dir() and not below:
            raise ClipFileError("clip", str(path), f"the folder has no clip ({', '.join(CLIP_SUFFIXES)})")
        for file in sorted(below) or [path]:
            place = file.relative_to(path if below else path.parent).with_suffix("")
            taken[place] += 1
            # walk.bvh and walk.c3d, or the same name from two folders
            out.append((file, place if taken[place] == 1 else place.with_name(f"{place.name}-{taken[place]}")))
    return out


def retarget_clips(jobs: Iterable[ClipJob], workers: int = 1, client: Any = None) -> Iterator[ClipDone]:
    """Retarget clips, each of which is kept when it is done, in the order in which they end.

    A clip that cannot be read or retargeted is an answer with its reason, and the others go on. Who stops asking, as by
    Ctrl-C, ends the processes; what was done by then stays.

    Args:
        workers: processes; 1: all is done in this one. client: of a Dask cluster, whose workers take them instead.
    """
    jobs = list(jobs)
    if client is None and (workers == 1 or len(jobs) < 2):
        yield from map(retarget_job, jobs)
        return
    # Forks of a process with threads may hang; Ctrl-C goes to all processes of a terminal, and the first one ends them
    context, deaf = multiprocessing.get_context("spawn"), (signal.SIGINT, signal.SIG_IGN)
    own = ProcessPoolExecutor(min(workers, len(jobs)), context, signal.signal, deaf) if client is None else None
    with own or client.get_executor(pure=False) as pool:
        waiting = {pool.submit(retarget_job, job): job for job in jobs}
        try:
            for future in as_completed(waiting):
                # A process that was killed is a reason too
                error = future.exception()
                failed = ClipDone(waiting[future], {}, f"{type(error).__name__}: {error}")
                yield future.result() if error is None else failed
        except BaseException:
            # Those that are busy would be waited for, and are forgotten by a pool that was shut down
            busy = list((getattr(pool, "_processes", None) or {}).values())
            for future in waiting:
                future.cancel()
            pool.shutdown(wait=False)
            for process in busy:
                process.terminate()
            raise


def retarget_job(job: ClipJob) -> ClipDone:
    """Retarget one clip and write its folder, whole or not at all."""
    try:
        clip = load_clip(job.clip, **job.loading)
        start = time.perf_counter()
        known = retargeter_of.cache_info().hits
        retargeter = retargeter_of(job.robot, tuple(sorted(job.options.items())), job.correspondence)
        first = retargeter_of.cache_info().hits == known
        motion = retargeter.run(clip)
        seconds = time.perf_counter() - start
        with _fresh(job.folder) as fresh:
            figures = write_report(motion, fresh, job.formats, seconds=seconds, film=job.film, support=job.support)
            retargeter.correspondence(clip.skeleton).save(fresh / "correspondence.yaml")
            figures |= {"asked": job.asked, "stack_made": first}
            (fresh / DONE).write_text(json.dumps(figures, indent=1) + "\n", encoding="utf-8")
        return ClipDone(job, figures)
    except WbcError as error:
        return ClipDone(job, {}, str(error))
    except OSError as error:
        return ClipDone(job, {}, f"{job.folder}: {error}")


@functools.lru_cache(maxsize=4)
def retargeter_of(robot: str, options: tuple[tuple[str, Any], ...], file: pathlib.Path | None) -> Retargeter:
    """A retargeter for all clips of this process, since its stack is made once; the same for the same arguments."""
    # Imported for clips that can be read
    from wbc.retarget.body import BodyError
    from wbc.retarget.options import RetargetOptions
    from wbc.retarget.retargeter import Retargeter
    from wbc.retarget.robot_body import RestPose, hand_plan

    own, given = robots.load(robot), RetargetOptions(**dict(options))
    stands = own.base == "floating" or hand_plan(RestPose(own, {})) is not None
    try:
        walks = own if stands else robots.load(robot, base="floating")
        return Retargeter(walks, None, given, correspondence=file)
    except BodyError:
        if stands:
            raise
        # Arms without legs stand where they are
        return Retargeter(own, None, given, correspondence=file)


@contextlib.contextmanager
def _fresh(folder: pathlib.Path) -> Iterator[pathlib.Path]:
    """A folder beside the one that is written, whose files move there at the end, the report last."""
    fresh = folder / ".writing"
    shutil.rmtree(fresh, ignore_errors=True)
    fresh.mkdir(parents=True)
    try:
        yield fresh
        (folder / DONE).unlink(missing_ok=True)
        for file in sorted(fresh.iterdir(), key=lambda file: file.name == DONE):
            file.replace(folder / file.name)
    finally:
        shutil.rmtree(fresh, ignore_errors=True)
