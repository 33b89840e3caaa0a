"""``wbc replay``: the ticks of a run again, bit for bit."""

from __future__ import annotations

import csv
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from wbc import validation
from wbc.cli.console import OutputError
from wbc.cli.reading import Option

if TYPE_CHECKING:
    from wbc.record import Recording

#: Exit code of a replay whose commands are not those of the recording
DIFFERS = 1

Trust = Annotated[bool, "Run code from the recording: items and functions that are not wbc's."]


@dataclass(frozen=True)
class ReplayRun:
    """Do the ticks of a recording again, bit for bit.

    Exit code 1 if a command differs. The stack comes from the recording, and without --trust only what this package
    declares is read from it.
    """

    recording: Annotated[Path, Option("A run folder of `wbc track`, or a recording.", placed=True)]
    backend: Annotated[Literal["as recorded", "auto", "native", "vm"], "How ticks are compiled."] = "as recorded"
    trust: Trust = False
    table: Annotated[Path | None, "Write the recording as CSV: times, joints, residuals, margins and inputs."] = None

    def run(self) -> int:
        from wbc import record, replaying
        from wbc.cli.console import progress_bar, show_figures, tell
        from wbc.cli.session import RECORDING, STRIDE

        recording = record.Recording(self.recording / RECORDING if self.recording.is_dir() else self.recording)
        if self.table is not None:
            save_table(recording, self.table)
        with progress_bar() as bar:
            stage = bar.add_task("replaying", total=None)

            def progress(ticks: int) -> None:
                if ticks % STRIDE == 0:
                    bar.update(stage, description=f"replaying, {ticks} ticks")

            chosen = None if self.backend == "as recorded" else self.backend
            found = replaying.replay(recording, backend=chosen, trust=self.trust, progress=progress)
        about = recording.about
        rows = {
            "stack": ", ".join(f"{name} ({kind})" for name, kind in about["items"]),
            "recorded": f"{found.ticks} ticks, dt {about['dt']:g} s, {about['solver']} ({about['backend']})",
            "replayed": f"{about['solver']} ({found.backend})",
            "result": str(found),
        }
        show_figures(f"{about['robot']}: {recording.path}", rows.items())
        for note in found.notes:
            tell(note, "note")
        if not found.complete:
            from wbc.log.file import NOT_CLOSED

            tell(f"the recording {NOT_CLOSED}", "note")
        return 0 if found.identical else DIFFERS


def save_table(recording: Recording, file: Path) -> None:
    """A row a tick; the head has the units.

    Raises:
        OutputError: there is such a file, or it cannot be written. RecordingError: of an older version.
    """
    columns, units = recording.table(), recording.units
    with validation.writing("table", file, OutputError), file.open("x", newline="", encoding="utf-8") as stream:
        writer = csv.writer(stream)
        writer.writerow(f"{name} [{units[name]}]" if name in units else name for name in columns)
        writer.writerows(zip(*columns.values(), strict=True))
