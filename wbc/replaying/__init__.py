"""The ticks of recordings again (floor 12)."""

from wbc.replaying.ticks import Replay, replay, replayed

__all__ = ["Replay", "replay", "replayed"]
