"""The native cycle and its numpy mirror use the same constants."""

from __future__ import annotations

import re
from importlib import resources

import pytest

from wbc.ik import descent, search
from wbc.tick import reach

NAMES = ("TRUSTED", "AT_LIMIT", "PUSHED", "NEGLIGIBLE", "LEAST_PIVOT", "BRAKING", "REMOVED", "CORRECTIONS")


def native(file: str, name: str) -> float:
    text = (resources.files("wbc.stack") / "native" / file).read_text()
    found = re.search(rf"^#define {name} (\S+)$", text, re.MULTILINE)
    assert found is not None, name
    return float(found.group(1))


@pytest.mark.parametrize("name", NAMES)
def test_of_reach(name: str) -> None:
    assert native("reach.h", name) == getattr(reach, name)


def test_of_margins() -> None:
    assert native("margins.h", "BRAKING_MARGIN") == reach.BRAKING_MARGIN
    assert native("settings.h", "DEAD") == reach.DEAD
    assert native("settings.h", "TOO_FAR") == reach.TOO_FAR


@pytest.mark.parametrize(
    "name",
    [
        "STRIDE",
        "SHORT_STRIDE",
        "EASE",
        "PATIENCE",
        "PROGRESS",
        "DESCENT",
        "SETTLING",
        "AT_REST",
        "GAINED",
        "RETURNS",
        "CLOSELY",
        "SEEKING",
    ],
)
def test_of_inverse_kinematics(name: str) -> None:
    assert native("converge.h", name) == getattr(descent, name)


@pytest.mark.parametrize("name", ["FOUND", "EXHAUSTED", "OUT_OF_TIME", "REFUSED"])
def test_of_endings(name: str) -> None:
    assert native("converge.h", f"WBC_{name}") == getattr(search, name)
