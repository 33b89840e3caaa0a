"""What makes, reads and changes structures refuses what is none, by the name of the argument."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from wbc import walking
from wbc.errors import WbcError

#: Nothing that any of the calls takes
NOTHING: tuple[Any, ...] = (None, 1e9, -1, True, object(), {}, [[1.0], [1.0, 2.0]], np.zeros((2, 2)), {3}, len)


@pytest.mark.parametrize("value", NOTHING, ids=lambda value: type(value).__name__)
@pytest.mark.parametrize(
    ("call", "field"),
    [
        (lambda x: walking.Structure("s", x), "holds"),
        (walking.parse_structure, "text"),
        (walking.read_structure, "path"),
        (lambda x: walking.save_structure(x, Path("never.csv")), "structure"),
        (lambda x: walking.save_structure(walking.plane(2, 2), x), "path"),
        (lambda x: walking.remove_fraction(x, 0.5), "structure"),
        (lambda x: walking.remove_rows(x, 1), "structure"),
        (lambda x: walking.remove_columns(x, 1), "structure"),
    ],
)
def test_other_things_are_refused(call: Callable[[Any], Any], field: str, value: Any) -> None:
    with pytest.raises(WbcError, match=field):
        call(value)


def test_switches_and_lengths() -> None:
    with pytest.raises(WbcError, match="rigid"):
        walking.cylinder(rigid=np.ones(2))  # type: ignore[arg-type]
    with pytest.raises(WbcError, match="length"):
        walking.module(length=1e9)
