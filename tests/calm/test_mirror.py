"""The native cycle and what Python does beside it use the same constants."""

from __future__ import annotations

import re
from importlib import resources

import pytest

from wbc.ik import descent, search


def native(file: str, name: str) -> float:
    text = (resources.files("wbc.stack") / "native" / file).read_text()
    found = re.search(rf"^#define {name} (\S+)$", text, re.MULTILINE)
    assert found is not None, name
    return float(found.group(1))


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
