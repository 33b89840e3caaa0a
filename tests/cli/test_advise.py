"""Modes, advice, restrictions and surveys of wbc coordinates as a user types them."""

from __future__ import annotations

import functools
from pathlib import Path

from tests.cli.test_commands import run as wbc_command

run = functools.partial(wbc_command, "coordinates")


def test_advice_on_a_locus() -> None:
    code, out, _ = run("advise", "spherical_4r", "--at", "0.3,1.5707963267948966,-0.7,1.1")
    assert code == 0
    lines = {line.split("  ")[0]: line for line in out.splitlines()}
    assert "algorithmic" in lines["tip | alpha"]
    assert "joint2 = 1.571" in lines["tip | alpha"]
    assert "regular" in lines["tip | beta"]
    assert out.splitlines()[-1] == "use: tip | beta"


def test_restrictions_are_written_as_recorded() -> None:
    code, out, _ = run("restrictions", "spherical_4r")
    assert code == 0
    assert out.strip() in (Path(__file__).parents[1] / "published" / "data" / "written_restrictions.md").read_text()


def test_a_survey_of_random_configurations() -> None:
    code, out, _ = run("survey", "spherical_4r", "--count", "40")
    assert code == 0
    first, least, where, parts, spent = out.splitlines()
    assert first.startswith("best of 7 pairs at 40 configurations")
    assert "adviser of 5 pairs" in spent
    # Advice at that configuration says the same
    ratio, name = least.split()[1][:-1], least.split(": ")[1].split(", task")[0]
    _, advice, _ = run("advise", "spherical_4r", where.strip(), "--no-exact")
    lines = {line.split("  ")[0]: line.split("  ")[1:] for line in advice.splitlines()}
    ratios = [float([x for x in rest if x.strip()][1]) for row, rest in lines.items() if row.startswith("tip |")]
    assert abs(max(ratios) - float(ratio)) < 2e-3
    assert name in lines
    quantiles = [float(part.split()[-1]) for part in parts.split(",")]
    assert float(ratio) <= quantiles[0] < quantiles[1] < quantiles[2] <= 1.0


PAGE = Path(__file__).parents[2] / "docs" / "coordinates.md"


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
