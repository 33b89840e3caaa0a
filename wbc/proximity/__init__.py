"""Distances between bodies that no expression states, measured in C (floor 2)."""

from wbc.proximity.body import MAX_PAIRS, OBSTACLE, Body
from wbc.proximity.sensor import PairSensor
from wbc.proximity.witness import Witness, distances, witnesses
from wbc.shapes import FAR

__all__ = ["FAR", "MAX_PAIRS", "OBSTACLE", "Body", "PairSensor", "Witness", "distances", "witnesses"]
