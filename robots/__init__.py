"""Robots by name."""

from wbc.robot.loading import load

__all__ = ["load"]
