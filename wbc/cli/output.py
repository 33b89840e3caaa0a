"""What runs leave: their folders, and what is written there."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

from wbc.cli.scene import Backend

#: What a recording of ticks is called in a run's folder, and its copy
RECORDED = ("ticks.npz", "ticks.mcap")
Mcap = Annotated[bool, "Record every tick, and write it as MCAP meanwhile: ticks.npz, ticks.mcap."]


@dataclass(frozen=True)
class TrackOutput:
    """Of a run along a path."""

    out: Annotated[Path | None, "Run folder. Default: runs/ROBOT-PATH-TIME."] = None
    force: Annotated[bool, "Write into a folder that has a run."] = False
    log: Annotated[Literal["parquet", "npz"], "Format of the log."] = "parquet"
    record: Annotated[bool, "Record the inputs of every tick, for `wbc replay`."] = True
    mcap: Mcap = False
    plots: Annotated[bool, "Draw the plots, the picture and the page that plays the run."] = True


@dataclass(frozen=True)
class Where:
    """Of a walk: its folder."""

    out: Annotated[Path | None, "Run folder. Default: runs/walk-ROBOT-SCENE-TIME."] = None
    force: Annotated[bool, "Write into a folder that has a run."] = False


@dataclass(frozen=True)
class WalkOutput(Where):
    """Of a walk: how it is done, and what is drawn."""

    backend: Backend = "auto"
    check: Annotated[bool, "Run the external checker."] = True
    mcap: Mcap = False
    pictures: Annotated[bool, "Draw plots, stills, animation and the replay page."] = True


#: What a track leaves where nothing else is asked for
TRACKED = TrackOutput()
#: Where a run goes where nothing else is asked for
FOLDER = Where()
#: What a walk leaves where nothing else is asked for
WALKED = WalkOutput()
