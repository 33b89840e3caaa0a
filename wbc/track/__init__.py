"""One robot follows one timed path: paths, the loop over ticks, the log and its plots (what ``wbc track`` runs)."""

from __future__ import annotations

from typing import TYPE_CHECKING

from wbc import lazy

if TYPE_CHECKING:
    from wbc.log import Log, load, save
    from wbc.track.clearance import clearances, self_clearances
    from wbc.track.path import Sample, SplinePath, TimedPath
    from wbc.track.path_file import read_path
    from wbc.track.presets import PRESETS, preset
    from wbc.track.run import track
    from wbc.track.scene import Scene
    from wbc.track.setup import MovingObstacle, PathRun
else:
    __getattr__ = lazy.attach(__name__, __file__)

__all__ = [
    "PRESETS",
    "Log",
    "MovingObstacle",
    "PathRun",
    "Sample",
    "Scene",
    "SplinePath",
    "TimedPath",
    "clearances",
    "load",
    "preset",
    "read_path",
    "save",
    "self_clearances",
    "track",
]


def __dir__() -> list[str]:
    return __all__
