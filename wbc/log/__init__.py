"""Logs: what every run leaves, named columns with units; one file while it is written, and one reader (floor 1)."""

from wbc.log.file import FileWriter, LogFile, LogFileError, LogWriter
from wbc.log.log import FORMATS, Log, load, save
from wbc.log.recorder import TickRecorder

__all__ = ["FORMATS", "FileWriter", "Log", "LogFile", "LogFileError", "LogWriter", "TickRecorder", "load", "save"]
