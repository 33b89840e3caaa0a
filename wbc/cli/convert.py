"""``wbc convert``: a run in the format of another tool."""

from __future__ import annotations

import time
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

from wbc.cli.reading import Option

#: Time between two looks at a run that is still written [s]
LOOK = 0.02


@dataclass(frozen=True)
class ConvertRun:
    """Write a run in the format of another tool, or show it in Foxglove.

    A run that is still written, or whose program was killed, is taken as far as it came. MCAP and Foxglove: numbers of
    every tick, joints, transforms, bodies, and why each command was what it was. rrd: the same for Rerun. lerobot: a
    data set of one episode. See docs/logs.md.

    Example: wbc convert runs/demo --to mcap
    """

    source: Annotated[Path, Option("A run folder, a recording or a log.", placed=True)]
    to: Annotated[Literal["mcap", "rrd", "csv", "npz", "lerobot", "foxglove"], "The format."] = "mcap"
    out: Annotated[
        Path | None, "File, folder of lerobot, or HOST:PORT of foxglove. Default: beside the run; 127.0.0.1:8765."
    ] = None
    rate: Annotated[float, "Ticks a second of which poses and binding rows are shown [1/s]."] = 30.0
    follow: Annotated[bool, "Go on while the run is written, until it is closed or Ctrl-C."] = False
    trust: Annotated[bool, "Run code from the recording: items and functions that are not wbc's."] = False

    def run(self) -> int:
        from wbc.cli.console import progress_bar, say, tell
        from wbc.formats import convert
        from wbc.interrupts import interrupts

        stopped = False

        def stop() -> None:
            nonlocal stopped
            if stopped or not self.follow:
                raise KeyboardInterrupt
            stopped = True

        def wait() -> bool:
            time.sleep(LOOK)
            return not stopped

        with progress_bar() as bar, interrupts(stop):
            stage = bar.add_task(f"to {self.to}", total=None)

            def progress(ticks: int) -> None:
                bar.update(stage, description=f"to {self.to}, {ticks} ticks")

            if self.to == "foxglove":
                tell(f"Foxglove connects to ws://{self.out or '127.0.0.1:8765'}", "note")
            file, remarks = convert(
                self.source,
                self.to,
                self.out,
                rate=self.rate,
                trust=self.trust,
                wait=wait if self.follow else None,
                progress=progress,
            )
        for remark in remarks:
            tell(remark, "note")
        if self.to != "foxglove":
            say(str(file))
        return 0
