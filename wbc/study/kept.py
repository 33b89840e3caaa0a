"""What the trials of a study found, in a folder that a killed run goes on from."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass
from pathlib import Path
from types import TracebackType
from typing import Any

from wbc import extras, validation
from wbc.errors import BusyError, RangeError, RobotFileError
from wbc.native.file_lock import lock
from wbc.study.declaration import Study
from wbc.study.scenario import Row, StudyTrial

STUDY = "study.json"
TRIALS = "trials.jsonl"
RESULTS = "results.parquet"
SUMMARY = "summary.json"
PLOT = "study.png"
FILES = (STUDY, TRIALS, RESULTS, SUMMARY, PLOT)


@dataclass(frozen=True)
class Done:
    """A trial that came to its end: what it found, or why it failed."""

    found: Row
    error: str = ""


class Kept:
    """The folder of a run. Each trial is a line of ``trials.jsonl``, written when it ends: a kill in the middle of one
    leaves half a line, which is dropped.

    Raises:
        BusyError: another process runs the study in this folder. RangeError: its trials are of another scenario, or of
            other code. RobotFileError: a file in it is damaged.
    """

    def __init__(self, folder: Path, study: Study) -> None:
        self.folder, self.study = folder, study
        folder.mkdir(parents=True, exist_ok=True)
        self._file = (folder / TRIALS).open("a+", encoding="utf-8")
        try:
            lock(self._file, wait=False)
        except OSError:
            self._file.close()
            raise BusyError("study", str(folder), "another process runs the study in this folder") from None
        try:
            self._done = self._read()
        except BaseException:
            self._file.close()
            raise
        (folder / STUDY).write_text(json.dumps(study.data(), indent=1) + "\n", encoding="utf-8")

    def _read(self) -> dict[str, Done]:
        self._file.seek(0)
        text = self._file.read()
        whole = text[: text.rfind("\n") + 1]
        if len(whole) != len(text):
            self._file.truncate(len(whole.encode()))
        lines = whole.splitlines()
        head = {"scenario": self.study.scenario.name, "version": self.study.scenario.version}
        if not lines:
            self._file.write(json.dumps(head) + "\n")
            self._file.flush()
            return {}
        try:
            rows = [json.loads(line) for line in lines]
            if rows[0] != head:
                raise RangeError(
                    "study", str(self.folder), f"holds trials of {rows[0]}, and this is {head}; take another folder"
                )
            return {row["trial"]: Done(row["found"], row["error"]) for row in rows[1:]}
        except (json.JSONDecodeError, KeyError, TypeError) as error:
            raise RobotFileError("study", str(self.folder / TRIALS), f"is damaged: {error}") from error

    def get(self, trial: StudyTrial) -> Done | None:
        """What a trial found; None if it is not done, or lacks a metric that is wanted now."""
        done = self._done.get(_key(trial))
        wanted = self.study.metrics or self.study.scenario.metrics
        return done if done is None or done.error or set(wanted) <= set(done.found) else None

    def put(self, trial: StudyTrial, done: Done) -> None:
        """Keep it, on disk before this returns to its caller's next trial."""
        self._file.write(json.dumps({"trial": _key(trial), "found": done.found, "error": done.error}) + "\n")
        self._file.flush()
        self._done[_key(trial)] = done

    def table(self) -> dict[str, list[Any]]:
        """All rows of what the study asks for and was found: trial, seed, parameters, metrics; in the study's order."""
        columns: dict[str, list[Any]] = {"trial": [], "seed": []}
        finished = [(k, t, d) for k, t in enumerate(self.study.trials()) if (d := self.get(t)) and not d.error]
        names = self.study.metrics or tuple(dict.fromkeys(name for _, _, done in finished for name in done.found))
        # A metric of the name of a parameter is told apart
        called = {name: f"{name} found" if name in self.study.scenario.parameters else name for name in names}
        for k, trial, done in finished:
            rows = len(next(iter(done.found.values())))
            for name, value in {"trial": k, "seed": trial.seed, **trial.parameters}.items():
                columns.setdefault(name, []).extend([value] * rows)
            for name in names:
                columns.setdefault(called[name], []).extend(done.found.get(name, [None] * rows))
        return columns

    def save(self) -> Path:
        """Write ``results.parquet``, with the study in its metadata.

        Raises:
            RobotFileError: it cannot be written.
        """
        extras.require("recordings", RESULTS)
        import pyarrow as pa
        import pyarrow.parquet as pq

        path = self.folder / RESULTS
        with validation.replacing("study", path, RobotFileError) as fresh:
            about = {"study": json.dumps(self.study.data())}
            pq.write_table(pa.table(self.table()).replace_schema_metadata(about), fresh)
        return path

    def __enter__(self) -> Kept:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, value: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._file.close()


def _key(trial: StudyTrial) -> str:
    return json.dumps(asdict(trial), sort_keys=True)
