"""One robot follows one timed path: paths, the loop over ticks, the log and its plots (what ``wbc track`` runs)."""

from __future__ import annotations

from typing import TYPE_CHECKING

from wbc import lazy

if TYPE_CHECKING:
    from wbc.log import Log as Log, load as load, save as save
    from wbc.track.clearance import clearances as clearances, self_clearances as self_clearances
    from wbc.track.path import Sample as Sample, SplinePath as SplinePath, TimedPath as TimedPath
    from wbc.track.path_file import read_path as read_path
    from wbc.track.presets import PRESETS as PRESETS, preset as preset
    from wbc.track.run import track as track
    from wbc.track.scene import Scene as Scene
    from wbc.track.setup import MovingObstacle as MovingObstacle, PathRun as PathRun
else:
    __getattr__, __dir__, __all__ = lazy.attach(__name__, __file__)
