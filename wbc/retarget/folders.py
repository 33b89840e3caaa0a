"""Many clips: found in folders, retargeted one by one or in parallel processes, each kept when it is done."""

from __future__ import annotations

import contextlib
import functools
import json
import multiprocessing
import os
import pathlib
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


#: A clip, figures of its report, and the reason why there are none; "" where there are
ClipDone = tuple[ClipJob, dict[str, Any], str]


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
                failed = f"{type(error).__name__}: {error}"
                yield future.result() if error is None else (waiting[future], {}, failed)
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
    """Retarget one clip and write its folder, the report last."""
    try:
        clip = load_clip(job.clip, **job.loading)
        start = time.perf_counter()
        retargeter = retargeter_of(job.robot, tuple(sorted(job.options.items())), job.correspondence)
        motion = retargeter.run(clip)
        seconds = time.perf_counter() - start
        job.folder.mkdir(parents=True, exist_ok=True)
        # While it is not there the folder is not done
        (job.folder / DONE).unlink(missing_ok=True)
        retargeter.correspondence(clip.skeleton).save(job.folder / "correspondence.yaml")
        more: dict[str, Any] = {"asked": job.asked}
        if job.support and motion.robot.base != "fixed":
            from wbc.retarget.holding_forces import held

            at_rest = held(motion)
            more |= {"held_at_rest": at_rest.share, "support": str(at_rest)}
        return job, write_report(motion, job.folder, job.formats, seconds=seconds, film=job.film, more=more), ""
    except WbcError as error:
        return job, {}, str(error)
    except OSError as error:
        return job, {}, f"{job.folder}: {error}"


@functools.lru_cache(maxsize=4)
def retargeter_of(robot: str, options: tuple[tuple[str, Any], ...], file: pathlib.Path | None) -> Retargeter:
    """A retargeter for all clips of this process, since its stack is made once; the same for the same arguments."""
    # Imported for clips that can be read
    from wbc.retarget.body import BodyError
    from wbc.retarget.options import RetargetOptions
    from wbc.retarget.retargeter import Retargeter
    from wbc.retarget.robot_body import RestPose, hand_plan

    own, given = robots.load(robot), RetargetOptions(**dict(options))
    if own.base != "floating" and hand_plan(RestPose(own, {})) is None:
        with contextlib.suppress(BodyError):
            return Retargeter(robots.load(robot, base="floating"), None, given, correspondence=file)
    # Hands, and arms without legs, stand where they are
    return Retargeter(own, None, given, correspondence=file)
