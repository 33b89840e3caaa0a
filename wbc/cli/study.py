"""``wbc study``: many trials of a scenario, over parameters and seeds, on this machine or a cluster."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, ClassVar

from wbc.cli.reading import Option
from wbc.errors import RangeError, RobotFileError

if TYPE_CHECKING:
    from wbc.study import Progress, Study

#: Exit code where a trial failed
FAILED = 1


@dataclass(frozen=True)
class Trials:
    """Do many trials of a scenario, here or on a cluster.

    Over parameters and seeds. Every trial is kept when it ends: after Ctrl-C, a kill or a lost worker, --resume goes
    on. See docs/study.md.

    Example: wbc study reach --seeds 20
    """

    PANEL: ClassVar[str] = "Where it runs, and what it writes"
    what: Annotated[
        str | None, Option("A YAML file, or a built-in scenario: reach, manipulability, layouts, ik.", placed=True)
    ] = None
    seeds: Annotated[int | None, "Seeds 0, 1, ... Default: the file's; of a built-in scenario 10."] = None
    workers: Annotated[int | None, "Processes of a cluster on this machine. Default: none."] = None
    address: Annotated[str | None, "Scheduler of a Dask cluster, as tcp://HOST:8786."] = None
    resume: Annotated[Path | None, "Folder of a run that was ended: goes on with it."] = None
    out: Annotated[Path | None, "Run folder. Default: runs/study-TIME."] = None
    force: Annotated[bool, "Write into a folder that has a study."] = False

    def run(self) -> int:
        from wbc.cli.app import INTERRUPTED
        from wbc.cli.console import data, progress_bar, say, tell
        from wbc.study import Kept, carry_out
        from wbc.study.summary import conclude

        asked, folder = self._asked()
        ended = False
        with Kept(folder, asked) as kept:
            with progress_bar() as bar:
                task = bar.add_task("trials", total=asked.count)

                def tick(now: Progress) -> None:
                    bar.update(task, completed=now.before + now.done)

                try:
                    carry_out(kept, workers=self.workers, address=self.address, tick=tick)
                except KeyboardInterrupt:
                    ended = True
            summary = conclude(kept)
        say(f"{summary['finished']} of {summary['trials']} trials, {summary['rows']} rows")
        for name, figures in summary["metrics"].items():
            say(f"  {name}: " + ", ".join(f"{key} {value:.6g}" for key, value in figures.items()))
        say(folder)
        data(summary)
        for failure in summary["failures"]:
            tell(f"failed: {failure}")
        if ended:
            tell(f"ended early; go on with: wbc study --resume {folder}")
            return INTERRUPTED
        return FAILED if summary["failed"] else 0

    def _asked(self) -> tuple[Study, Path]:
        """The study, and its folder."""
        from wbc import validation
        from wbc.cli.folders import run_folder
        from wbc.study import Study
        from wbc.study.kept import FILES, STUDY

        if (self.what is None) == (self.resume is None):
            raise RangeError("study", self.what, "expected a file, a scenario, or --resume FOLDER")
        if self.what is not None:
            if validation.is_file("study", self.what) or Path(self.what).suffix:
                asked = Study.read(self.what, self.seeds)
            else:
                asked = Study(scenario=self.what, seeds=10 if self.seeds is None else self.seeds)
            return asked, run_folder(self.out, "study", FILES, self.force)
        folder = self.resume or Path()
        for option, value in (("seeds", self.seeds), ("out", self.out), ("force", self.force or None)):
            if value is not None:
                raise RangeError(option, value, "--resume goes on with the study of its folder as it was asked for")
        if not (folder / STUDY).is_file():
            there = validation.exists("resume", folder)
            reason = "holds no study" if there else validation.no_such(folder, "there is no such folder")
            raise RobotFileError("resume", str(folder), reason)
        return Study.read(folder / STUDY), folder
