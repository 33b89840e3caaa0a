"""What else the robot could have done: all rates of a tick, self-motion, and the best way along a path. docs/fsp.md."""

from __future__ import annotations

from wbc.explore.explorer import Choices, Explorer, Piece, Resolution

__all__ = ["Choices", "Explorer", "Piece", "Resolution"]
