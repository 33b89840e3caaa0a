"""Recordings of ticks (floor 9)."""

from wbc.record.recorder import Recorder, record
from wbc.record.recording import Recording, RecordingError

__all__ = ["Recorder", "Recording", "RecordingError", "record"]
