"""``wbc retarget``: clips of people and animals onto a robot, in parallel, resumable, with a report a clip."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal

from wbc.cli import completion
from wbc.cli.reading import Option
from wbc.cli.scene import Force

if TYPE_CHECKING:
    from wbc.retarget import ClipDone, ClipJob

#: Exit code where a clip failed
FAILED = 1
#: Formats of a motion, besides npz
MotionFormat = Literal["csv", "csv-plain", "gmr", "keyframes", "log"]


@dataclass(frozen=True)
class ClipOptions:
    """What a file does not say of itself."""

    PANEL: ClassVar[str] = "What the clips are"
    body_model: Annotated[Path | None, "Your file of SMPL, SMPL-H or SMPL-X (npz, pkl), for AMASS clips."] = None
    names: Annotated[str | None, "Layout of an array without names: smplx, smplh, lafan, mocap, human36m, ..."] = None
    rate: Annotated[float | None, "Frames a second where a file does not say [Hz]."] = None
    up: Annotated[Literal["x", "y", "z", "-x", "-y", "-z"] | None, "Axis of the files that is up. Default: found."] = (
        None
    )
    unit: Annotated[Literal["m", "cm", "mm", "in", "ft"] | None, "Unit of the files. Default: found."] = None

    def loading(self) -> dict[str, Any]:
        """As :func:`wbc.retarget.load_clip` takes them."""
        model = None if self.body_model is None else str(self.body_model)
        given = {"body_model": model, "names": self.names, "rate": self.rate, "up": self.up, "unit": self.unit}
        return {name: value for name, value in given.items() if value is not None}


@dataclass(frozen=True)
class RetargetClips:
    """Retarget clips of people and animals to a robot, with feet that stand still.

    Reads BVH, C3D, AMASS and SMPL (npz, pkl) and key points (npy, npz, csv). Each clip gets a folder with motion,
    report and film. A clip that is done is not done again: after Ctrl-C the same command goes on. Ends with 1 if a clip
    failed.

    Example: wbc retarget walk.bvh clips/ --robot g1 --format gmr
    """

    PANEL: ClassVar[str] = "What it does"
    clips: Annotated[tuple[str, ...], Option("Files of clips, and folders of them.", placed=True)]
    robot: Annotated[str, Option("A name of `wbc robots`, or a URDF or MJCF file.", complete=completion.robots)] = "g1"
    output_rate: Annotated[float | None, "Frames a second of the motion [Hz]. Default: the clip's."] = None
    scale: Annotated[float | None, "Metres of the robot for one of the clip [1]. Default: of the legs' lengths."] = None
    clearance: Annotated[float | None, "Links keep this distance from each other [m]. Default: not asked for."] = None
    balance: Annotated[float, "Weight that draws the centre of mass over the contacts [1]; 0: it is not."] = 0.0
    correspondence: Annotated[Path | None, "Corrected correspondence.yaml of a clip's folder, for all clips."] = None
    correct: Annotated[Path | None, "Correct what leads what by dragging, in the browser, into this file; no more."] = (
        None
    )
    clip: Annotated[ClipOptions, "What the clips are"] = ClipOptions()
    format: Annotated[tuple[MotionFormat, ...], "Format besides npz; may be repeated."] = ()
    film: Annotated[bool, "Draw a film of each."] = True
    support: Annotated[bool, "Say in how many frames contact forces and motors hold the robot at rest."] = False
    workers: Annotated[int | None, "Processes. Default: one a core, at most one a clip."] = None
    address: Annotated[str | None, "Scheduler of a Dask cluster, as tcp://HOST:8786."] = None
    out: Annotated[Path | None, "Folder of the clips' folders. Default: runs/retarget-ROBOT."] = None
    force: Force = False

    def run(self) -> int:
        from wbc.cli.app import INTERRUPTED
        from wbc.cli.console import data, progress_bar, say, tell
        from wbc.retarget import retarget_clips

        jobs, out = self._jobs()
        if self.correct is not None:
            self._correct(jobs[0], self.correct)
            return 0
        waiting = jobs if self.force else [job for job in jobs if not job.is_done]
        if len(waiting) < len(jobs):
            tell(f"{len(jobs) - len(waiting)} of {len(jobs)} clips are done already; --force does them again", "note")
        ended: list[ClipDone] = []
        interrupted = False
        with progress_bar() as bar:
            task = bar.add_task(f"clips to {self.robot}", total=len(jobs), completed=len(jobs) - len(waiting))
            try:
                with self._client() as client:
                    for done in retarget_clips(waiting, self._count(len(waiting)), client):
                        ended.append(done)
                        bar.advance(task)
            except KeyboardInterrupt:
                interrupted = True
        for job, figures, reason in ended:
            say(_line(job, figures)) if not reason else tell(f"failed: {job.clip}: {reason}")
        failed = [reason for _, _, reason in ended if reason]
        say(f"{out}: {len(jobs) - len(waiting) + len(ended) - len(failed)} of {len(jobs)} clips")
        data(
            {
                "folder": str(out),
                "clips": [{"file": str(job.clip), "reason": reason, **figures} for job, figures, reason in ended],
            }
        )
        if interrupted:
            tell("ended early; the same command goes on")
            return INTERRUPTED
        return FAILED if failed else 0

    def _correct(self, job: ClipJob, file: Path) -> None:
        """Show the correspondence of a clip until the page is closed or Ctrl-C."""
        from wbc.cli.console import say
        from wbc.cli.view import show as show_address
        from wbc.retarget import CorrespondenceEditor, load_clip
        from wbc.retarget.folders import retargeter_of
        from wbc.viewer import show
        from wbc.viewer.paced import ticks

        retargeter = retargeter_of(job.robot, tuple(sorted(job.options.items())), job.correspondence)
        editor = CorrespondenceEditor(retargeter.correspondence(load_clip(job.clip, **job.loading).skeleton), file)
        with contextlib.suppress(KeyboardInterrupt), show(editor.controller) as viewer:
            show_address(viewer.url)
            say("drag a target to the point that leads it; Ctrl-C ends")
            for _ in ticks(viewer, editor.controller.stack.dt, None):
                viewer.update(editor.controller.step(editor.q))
                editor.look(viewer.stopped)
        say(f"{file}: is given by --correspondence")

    def _jobs(self) -> tuple[list[ClipJob], Path]:
        """The clips, and the folder of theirs."""
        from wbc import robots, validation
        from wbc.cli.console import OutputError
        from wbc.errors import RangeError
        from wbc.retarget import ClipJob, CorrespondenceError, find_clips

        if not self.clips:
            raise RangeError("clips", self.clips, "give files of clips, or folders of them")
        found = find_clips(self.clips)
        # A robot that is not there is said before the first clip
        robots.load(self.robot, base="floating")
        out = self.out or Path("runs") / f"retarget-{Path(self.robot).stem}"
        with validation.writing("out", out, OutputError, ValueError):
            out.mkdir(parents=True, exist_ok=True)
        options = {"rate": self.output_rate, "scale": self.scale, "clearance": self.clearance}
        given: dict[str, Any] = {name: value for name, value in options.items() if value is not None}
        given |= {"balance": self.balance} if self.balance else {}
        loading = self.clip.loading()
        file = self.correspondence
        if file is not None:
            validation.text_of("correspondence", file, CorrespondenceError)
        return [
            ClipJob(clip, out / place, self.robot, loading, given, self.format, self.film, self.support, file)
            for clip, place in found
        ], out

    def _count(self, clips: int) -> int:
        """Processes."""
        from wbc import validation
        from wbc.cores import cores

        if self.workers is None:
            return max(1, min(cores(), clips))
        return validation.integer("workers", self.workers, 1, 1024)

    @contextlib.contextmanager
    def _client(self) -> Iterator[Any]:
        """Of the Dask cluster that was asked for; None: there is none."""
        if self.address is None:
            yield None
            return
        from wbc.study.carrying_out import connected

        with connected(None, self.address) as client:
            yield client


def _line(job: ClipJob, figures: dict[str, Any]) -> str:
    """A clip that was retargeted, in a line."""
    parts = [
        f"{figures['frames']} frames", f"{figures['frames_a_second']:.4g} a second",
        f"slide {1e3 * figures['slide']:.3g} mm", f"gave way {len(figures['given_up'])}",
    ]  # fmt: skip
    if "penetration" in figures:
        parts.insert(3, f"below ground {1e3 * figures['penetration']:.3g} mm")
    return f"{job.folder}: {', '.join(parts)}"
