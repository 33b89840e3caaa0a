"""Ticks of thousands of robots in one call (floor 7): :meth:`wbc.Controller.batch`."""

from wbc.batch.batch import Batch
from wbc.batch.batch_step import BatchStep

__all__ = ["Batch", "BatchStep"]
