"""Tests in an environment without packages that some platforms lack, see tests/without.py.

Where Pinocchio is not installed, tests that speak its language get the package's own names. A test that fails for want
of one of these packages is skipped by the package's name; the last line says how many.
"""

from __future__ import annotations

import re
import sys
from collections import Counter
from collections.abc import Generator
from importlib.util import find_spec

import pytest

#: Module -> package
OPTIONAL = {"pinocchio": "pin", "coal": "coal", "toppra": "toppra", "ruckig": "ruckig"}
#: Those that are too large for the environment of the tests
OPTIONAL |= {
    "cyclonedds": "cyclonedds",
    "foxglove": "foxglove-sdk",
    "mcap_protobuf": "mcap-protobuf-support",
    "pxr": "usd-core",
    "rerun": "rerun-sdk",
    "torch": "torch",
}
#: Extras that bring them
EXTRAS = "foxglove|laws|protobuf|rerun|ros2|torch|usd"
LACKING = {module: package for module, package in OPTIONAL.items() if find_spec(module) is None}
#: What an error says in this process or another
_WANTED = re.compile(
    rf"No module named '({'|'.join(LACKING)})'"
    rf"|needs this package: pip install '?({'|'.join(LACKING.values())}|wbc\[(?:{EXTRAS})\])"
)
_skipped: Counter[str] = Counter()

if "pinocchio" in LACKING:
    from wbc.multibody import own

    sys.modules["pinocchio"] = own


def _reason(report: pytest.TestReport | pytest.CollectReport) -> str | None:
    """The package that a failure is for want of."""
    if not LACKING or not report.failed:
        return None
    said = "\n".join([report.longreprtext, *(text for _, text in report.sections)])
    match = _WANTED.search(said)
    return match and (match[1] or match[2])


def _skip(report: pytest.TestReport | pytest.CollectReport, where: str) -> None:
    if (reason := _reason(report)) is not None:
        report.outcome, report.longrepr = "skipped", (where, 0, f"Skipped: {reason} is not installed")


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item: pytest.Item) -> Generator[None, pytest.TestReport, pytest.TestReport]:
    report = yield
    _skip(report, str(item.path))
    return report


@pytest.hookimpl(wrapper=True)
def pytest_make_collect_report(
    collector: pytest.Collector,
) -> Generator[None, pytest.CollectReport, pytest.CollectReport]:
    report = yield
    _skip(report, str(collector.path))
    return report


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    if not LACKING:
        return
    counts = {key: len(terminalreporter.getreports(key)) for key in ("passed", "failed", "skipped")}
    for report in terminalreporter.getreports("skipped"):
        match = re.search(r"Skipped: (\S+) is not installed", str(report.longrepr))
        _skipped[match[1] if match else "other reasons"] += 1
    by = ", ".join(f"{count} for {name}" for name, count in sorted(_skipped.items()))
    terminalreporter.write_line(
        f"without {', '.join(LACKING.values())}: {counts['passed']} tests passed, {counts['failed']} failed, "
        f"{counts['skipped']} skipped ({by or 'none'})"
    )
