"""Recordings of ticks and their replay (floor 7)."""

from wbc.record.recorder import Recorder, record
from wbc.record.recording import Recording, RecordingError
from wbc.record.replaying import Replay, replay, replayed

__all__ = ["Recorder", "Recording", "RecordingError", "Replay", "record", "replay", "replayed"]
