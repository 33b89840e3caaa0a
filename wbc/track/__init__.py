"""One robot follows one timed path: paths, the loop over ticks, the log and its plots (what ``wbc track`` runs)."""

from wbc.track.clearance import clearances, self_clearances
from wbc.track.log import Log, load, save
from wbc.track.path import Path, Sample, SplinePath
from wbc.track.path_file import read_path
from wbc.track.presets import PRESETS, preset
from wbc.track.run import track
from wbc.track.scene import Scene
from wbc.track.setup import Moving, Plan

__all__ = [
    "PRESETS",
    "Log",
    "Moving",
    "Path",
    "Plan",
    "Sample",
    "Scene",
    "SplinePath",
    "clearances",
    "load",
    "preset",
    "read_path",
    "save",
    "self_clearances",
    "track",
]
