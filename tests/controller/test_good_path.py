"""A tick that is solved pays nothing for what explains, differentiates and replaces answers."""

from __future__ import annotations

import subprocess
import sys

import pytest

from tests.repeats import ALL, MORE

PROGRAM = """
import sys
from tests.stack import small
from wbc.controller import core_of
controller = small.stack().compile(backend={backend!r})
q = controller.stack.robot.neutral
statuses = {{str(controller.step(q).status) for _ in range(50)}}
assert statuses == {{"solved"}}, statuses
asked_for = ("explaining", "losses", "naming", "past", "sensitivity")
loaded = {{name for name in sys.modules if name.startswith("wbc.")}}
print(sorted(loaded & {{"wbc.explain." + name for name in asked_for}}), end=" ")
print(sorted(loaded & {{"wbc.qp.conflict", "wbc.qp.sensitivity", "wbc.qp.levels.sensitivity"}}), end=" ")
print(sorted(core_of(controller).fallback._links))
controller.step(q).explain()
assert "wbc.explain.losses" in sys.modules
"""


@pytest.mark.parametrize("backend", ["vm", "native"] if MORE >= ALL else ["vm"])
def test_nothing_of_it_is_even_loaded(backend: str) -> None:
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM.format(backend=backend)], capture_output=True, text=True, check=True
    )
    # The links of the chain are made at compile, since a tick that needs one has no time for it
    assert done.stdout == "[] [] ['daqp']\n"
