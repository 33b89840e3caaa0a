"""Runs: walks as they are asked for, carried out, logged, and shown in a folder."""

from wbc.walking.run.perform import WalkRun, perform_walk
from wbc.walking.run.request import WalkRequest

__all__ = ["WalkRequest", "WalkRun", "perform_walk"]
