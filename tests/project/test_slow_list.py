"""The list of tests that ``make check`` leaves out names tests that are there."""

from __future__ import annotations

import re

from tests.project.layout import ROOT
from tests.slow import LIST


def test_every_slow_test_is_there() -> None:
    names = LIST.read_text().split()
    assert names == sorted(names)
    gone = []
    for name in names:
        file, _, test = name.partition("::")
        there = (ROOT / file).is_file() and (not test or re.search(rf"def {test}\b", (ROOT / file).read_text()))
        gone += [] if there else [name]
    assert gone == []
