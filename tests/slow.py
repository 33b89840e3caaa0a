"""Tests that ``make check`` leaves out: those named in slow.txt, which ``pytest -n 0 --find-slow`` writes anew.

Times are of the processor, with children, so that other work on the machine does not count.
"""

from __future__ import annotations

import operator
import os
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

LIST = Path(__file__).with_name("slow.txt")
#: Processor time of a test with all its cases, or of what it shares with others, from which on it is slow [s]
LIMIT = 0.2

_times: dict[str, float] = {}


def name_of(item: pytest.Item) -> str:
    """A test without its case: cases come and go."""
    return item.nodeid.split("[")[0]


def file_of(item: pytest.Item) -> str:
    """Its file."""
    return item.nodeid.split("::")[0]


def spent() -> float:
    """Processor time of this process and its children that have ended [s]."""
    return sum(os.times()[:4])


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption(
        "--find-slow", action="store_true", help="write the tests of this run that are slow to tests/slow.txt"
    )


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    slow = set(LIST.read_text().split())
    for item in items:
        if {name_of(item), file_of(item)} & slow:
            item.add_marker(pytest.mark.slow)


@pytest.hookimpl(wrapper=True)
def pytest_runtest_setup(item: pytest.Item) -> Iterator[None]:
    """What tests of a file share costs the first of them that runs, so all of them are slow."""
    return (yield from _timed(item, file_of(item), max))


@pytest.hookimpl(wrapper=True)
def pytest_runtest_call(item: pytest.Item) -> Iterator[None]:
    return (yield from _timed(item, name_of(item), operator.add))


def _timed(item: pytest.Item, name: str, together: Callable[[float, float], float]) -> Iterator[None]:
    # Asking for processor time costs more than many a test
    if not item.config.getoption("--find-slow"):
        return (yield)
    began = spent()
    result = yield
    _times[name] = together(_times.get(name, 0.0), spent() - began)
    return result


def pytest_sessionfinish(session: pytest.Session) -> None:
    """Names of tests that did not run stay."""
    if session.config.getoption("--find-slow"):
        known = set(LIST.read_text().split()) - set(_times)
        slow = known | {name for name, seconds in _times.items() if seconds >= LIMIT}
        # A file stands for its tests
        apart = [name for name in sorted(slow) if "::" not in name or name.split("::")[0] not in slow]
        LIST.write_text("".join(f"{name}\n" for name in apart))
