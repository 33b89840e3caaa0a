"""Tests of the viewer that need what is no part of the lock are there where it is; elsewhere a line says what is left
out.
"""

from __future__ import annotations

import importlib.util
from pathlib import Path

from tests.chromium import program

NONE = "no Chromium is installed (apt-get install chromium)"
#: Files of tests/viewer that cannot run here, and why
LEFT_OUT = {
    name: why
    for name, why, there in (
        ("test_browser.py", NONE, program() is not None),
        ("test_browser_walk.py", NONE, program() is not None),
        ("test_zeromq.py", "pyzmq is not installed (make setup)", importlib.util.find_spec("zmq") is not None),
    )
    if not there
}


def pytest_report_header() -> list[str]:
    """What is left out, in the first lines of the output."""
    return [f"left out: tests/viewer/{name}, as {why}" for name, why in LEFT_OUT.items()]


def pytest_ignore_collect(collection_path: Path) -> bool | None:
    """Leave them out."""
    return True if collection_path.name in LEFT_OUT and collection_path.parent.name == "viewer" else None
