"""The external checker of walks: it shares no code with planning, control or simulation."""

from wbc.walking.checker.check import check_run, check_walk
from wbc.walking.checker.report import Finding, Report
from wbc.walking.checker.rules import Rules

__all__ = ["Finding", "Report", "Rules", "check_run", "check_walk"]
