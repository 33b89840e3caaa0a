"""Robot description files: where they are, whether they can be read, and what the parser says."""

from __future__ import annotations

import contextlib
import functools
import os
import pathlib
import sys
import threading
import xml.etree.ElementTree as ElementTree
from collections.abc import Iterator

from wbc.errors import RobotFileError
from wbc.extras import MissingPackageError
from wbc.robot.sources.xml_text import parse

#: What the C++ parsers' exceptions become in Python.
PARSER_ERRORS = (ValueError, RuntimeError, IndexError, OverflowError)

_DATA_WHEEL = "example-robot-data"
_stderr_lock = threading.Lock()


@functools.cache
def example_data_folder() -> pathlib.Path:
    """The folder ``robots`` of the example-robot-data wheel: where wheels of its kind put what is no Python, else found
    through the wheel's own list of files.

    Raises:
        MissingPackageError: the wheel is not installed. RobotFileError: it has no robots.
    """
    import sysconfig  # not needed for files of a user's own

    folder = pathlib.Path(sysconfig.get_path("purelib"), "cmeel.prefix", "share", _DATA_WHEEL, "robots").resolve()
    return folder if folder.is_dir() else listed_data_folder()


def listed_data_folder() -> pathlib.Path:
    """The same by the wheel's list alone; slower, as reading it imports the parsers of mail.

    Raises:
        RobotFileError: as :func:`example_data_folder`.
    """
    from importlib import metadata

    try:
        files = metadata.distribution(_DATA_WHEEL).files or []
    except metadata.PackageNotFoundError as error:
        reason = "descriptions of robots by name are in this package: pip install 'wbc[robots]'"
        raise MissingPackageError("robot", _DATA_WHEEL, reason) from error
    for file in files:
        if file.suffix == ".urdf":
            parts = file.parts
            return pathlib.Path(str(file.locate())).resolve().parents[len(parts) - 1 - parts.index("robots") - 1]
    raise RobotFileError("robot", _DATA_WHEEL, "the installed package lists no URDF file")


def read_xml(path: pathlib.Path) -> tuple[str, ElementTree.Element]:
    """(text, root element) of a robot description.

    Raises:
        RobotFileError: missing, a directory, unreadable, or not XML, see :mod:`wbc.robot.sources.xml_text`.
    """
    if not path.exists():
        raise RobotFileError("robot", str(path), "there is no such file")
    if path.is_dir():
        raise RobotFileError("robot", str(path), "this is a directory, expected a URDF, SDF or MJCF file")
    try:
        data = path.read_bytes()
    except OSError as error:
        raise RobotFileError("robot", str(path), f"cannot be read: {error}") from error
    try:
        text = data.decode("utf-8")
    except UnicodeDecodeError:
        text = data.decode("latin-1")
    try:
        return text, parse(text)
    except ElementTree.ParseError as error:
        raise RobotFileError("robot", str(path), f"cannot be read, not well-formed XML: {error}") from error


class Noise:
    """What native code wrote to the standard error stream; empty until :func:`captured_stderr` ends."""

    def __init__(self) -> None:
        self.text = ""

    @property
    def reason(self) -> str:
        """The text on one line, without the parser's own source positions."""
        lines = [line.strip() for line in self.text.splitlines()]
        kept = [line.removeprefix("Error:").strip() for line in lines if line and not line.startswith("at line")]
        return "; ".join(kept)


@contextlib.contextmanager
def captured_stderr() -> Iterator[Noise]:
    """Collects what C++ code writes to file descriptor 2, which Python's ``sys.stderr`` cannot intercept.

    One thread at a time; other threads' messages in that span are collected too, and shown by the caller.
    """
    import tempfile

    noise = Noise()
    with _stderr_lock, tempfile.TemporaryFile() as store:
        if sys.stderr is not None:
            sys.stderr.flush()
        try:
            kept = os.dup(2)
        except OSError:  # a process without a standard error stream has nothing to keep clean
            yield noise
            return
        os.dup2(store.fileno(), 2)
        try:
            yield noise
        finally:
            os.dup2(kept, 2)
            os.close(kept)
            store.seek(0)
            noise.text = store.read().decode(errors="replace")
