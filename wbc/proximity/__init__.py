"""Distances between bodies that no expression states, measured with Coal (floor 2)."""

from wbc.proximity.body import OBSTACLE, Body
from wbc.proximity.reference import Witness, distances, witnesses
from wbc.proximity.sensor import MAX_PAIRS, PairSensor
from wbc.shapes import FAR

__all__ = ["FAR", "MAX_PAIRS", "OBSTACLE", "Body", "PairSensor", "Witness", "distances", "witnesses"]
