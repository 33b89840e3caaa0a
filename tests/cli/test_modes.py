"""``wbc coordinates`` as a user types it."""

from __future__ import annotations

import functools
from pathlib import Path

from tests.cli.test_commands import run as wbc_command

PAGE = Path(__file__).parents[2] / "docs" / "coordinates.md"

run = functools.partial(wbc_command, "coordinates")


def test_table_of_all_arms() -> None:
    code, out, err = run()
    assert code == 0
    assert "ssrms" in out
    assert "M7 carrier with held hands" in err


def test_one_arm() -> None:
    code, out, _ = run("modes", "spdm")
    assert code == 0
    assert "M6 two arms: arm1_xi | the rest" in out
    assert "M7 carrier with held hands: no carrier" in out


def test_the_page_has_the_table() -> None:
    code, out, _ = run("--markdown")
    assert code == 0
    assert out.strip() in PAGE.read_text()


def test_unknown_arm() -> None:
    assert run("modes", "srms")[0] == 2
