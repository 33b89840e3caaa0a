"""Tests that fail are named when they fail. With ``--failed-list FILE`` their names are written there as well, so that
a run that is stopped leaves them: ``pytest @FILE`` runs them again.
"""

from __future__ import annotations

from pathlib import Path

import pytest

#: Letters of the reason
MOST = 160


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption(
        "--failed-list", type=Path, metavar="FILE", help="write the name of a test that fails there at once"
    )


def pytest_configure(config: pytest.Config) -> None:
    # Processes of xdist tell the first one
    if not hasattr(config, "workerinput"):
        config.pluginmanager.register(Failures(config), "failures")


class Failures:
    """What has failed so far."""

    def __init__(self, config: pytest.Config) -> None:
        self._config, self._names = config, list[str]()
        self._file: Path | None = config.getoption("--failed-list")
        if self._file is not None:
            self._file.parent.mkdir(parents=True, exist_ok=True)
            self._file.write_text("")

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        self._take(report)

    def pytest_collectreport(self, report: pytest.CollectReport) -> None:
        self._take(report)

    def _take(self, report: pytest.TestReport | pytest.CollectReport) -> None:
        if not report.failed or report.nodeid in self._names:
            return
        self._names.append(report.nodeid)
        if self._file is not None:
            with self._file.open("a") as file:
                file.write(f"{report.nodeid}\n")
        terminal = self._config.pluginmanager.get_plugin("terminalreporter")
        if terminal is not None and terminal.verbosity <= 0:
            crash = getattr(report.longrepr, "reprcrash", None)
            reason = f" - {crash.message.splitlines()[0][:MOST]}" if crash and crash.message else ""
            # Dots are on the line
            terminal.write(f"\nFAILED {report.nodeid}{reason}\n", flush=True, red=True)

    def pytest_terminal_summary(self, terminalreporter: pytest.TerminalReporter) -> None:
        if self._names and self._file is not None:
            terminalreporter.write_line(f"{len(self._names)} failed; again: make test PYTEST_ARGS=@{self._file}")
