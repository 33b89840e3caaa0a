"""Bad declarations of the plane of an arm."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from tests.tasks.planes import (
    LIMIT,
    OFFSET,
    PANDA,
    TALOS,
    robot,
)
from wbc.errors import BoundsError, NotFiniteError, RangeError, ShapeError, UnknownNameError
from wbc.tasks._stereographic import PlaneReference


@pytest.mark.parametrize(
    ("error", "field_name", "make"),
    [
        (RangeError, "reference.pole", lambda: PlaneReference(pole=(0, 0, 0))),
        (RangeError, "reference.direction", lambda: PlaneReference(direction=(0, 0, 2))),
        (NotFiniteError, "reference.direction", lambda: PlaneReference(direction=(np.nan, 0, 2))),
        (ShapeError, "reference.pole", lambda: PlaneReference(pole=(0, 1))),
        (ShapeError, "reference", lambda: replace(PANDA, reference=(0, 0, 1))),
        (ShapeError, "elbow_offset", lambda: replace(PANDA, elbow_offset=(0, 1))),
        (RangeError, "line_width", lambda: replace(PANDA, line_width=0)),
        (RangeError, "elbow_width", lambda: replace(PANDA, elbow_width=1.5)),
        (RangeError, "reference_width", lambda: replace(PANDA, reference_width=4)),
        (NotFiniteError, "reference_width", lambda: replace(PANDA, reference_width=np.nan)),
        (BoundsError, "lower", lambda: replace(LIMIT, lower=1.0)),
        (RangeError, "upper", lambda: replace(LIMIT, upper=-0.5 + 2 * np.pi)),
        (NotFiniteError, "upper", lambda: replace(LIMIT, upper=np.inf)),
        (UnknownNameError, "elbow", lambda: replace(PANDA, elbow="panda_lnk4").validate(robot("panda"))),
        (UnknownNameError, "base", lambda: replace(PANDA, base="torso").validate(robot("panda"))),
        (UnknownNameError, "axis", lambda: replace(PANDA, axis="panda_joint44").validate(robot("panda"))),
        (UnknownNameError, "axis", lambda: replace(TALOS, axis="root_joint").validate(robot("talos"))),
        (RangeError, "wrist", lambda: replace(PANDA, wrist="panda_link2").validate(robot("panda"))),
        (RangeError, "axis", lambda: replace(PANDA, axis="panda_joint1").validate(robot("panda"))),
        (RangeError, "axis", lambda: replace(OFFSET, axis="joint3", base="F2").validate(robot("ssrms"))),
    ],
)
def test_bad_input(error: type[Exception], field_name: str, make: Callable[[], Any]) -> None:
    with pytest.raises(error) as caught:
        make()
    assert caught.value.field == field_name


def test_nearest_names_come_first() -> None:
    with pytest.raises(UnknownNameError) as caught:
        replace(PANDA, elbow="panda_lnk4").validate(robot("panda"))
    assert caught.value.choices[0] == "panda_link4"


def test_plain_numbers_are_welcome() -> None:
    item = replace(PANDA, elbow_offset=np.array([0, 0, 1], dtype=np.float32), reference_width=1)
    assert item.elbow_offset == (0.0, 0.0, 1.0)
    assert hash(item) == hash(replace(item))
    assert PlaneReference(pole=[0, 0, 5], direction=[3, 0, 1]) == PlaneReference()
