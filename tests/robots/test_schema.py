"""The table's files are checked field by field."""

from __future__ import annotations

from pathlib import Path

import pytest

from wbc.errors import (
    DuplicateNameError,
    NotFiniteError,
    RangeError,
    RobotFileError,
    ShapeError,
    UnknownNameError,
    WbcError,
)
from wbc.robot.sources.table import read_table

GOOD = '[arm]\nfile = "a/b.urdf"\n'
BAD = {
    'colour = "red"': UnknownNameError,
    'name = "x"': UnknownNameError,
    'base = "flaoting"': UnknownNameError,
    "about = 3": ShapeError,
    'about = ""': ShapeError,
    "lock = 3": ShapeError,
    "lock = { j = nan }": NotFiniteError,
    "frames = ['tip']": ShapeError,
    "frames = { tip = 3 }": ShapeError,
    'neutral = { j = "x" }': ShapeError,
    "acceleration = { j = -1.0 }\nsource = 's'": RangeError,
    "acceleration = { j = 1.0 }": RangeError,
    "source = 's'": RangeError,
    "state = 'home'": RangeError,
    "shapes = 3": ShapeError,
    "shapes = [{ link = 'l', a = [0, 0, 0] }]": ShapeError,
    "shapes = [{ link = 'l', a = [0, 0], b = [0, 0, 1], radius = 1 }]": ShapeError,
    "shapes = [{ link = 'l', a = [0, 0, 0], b = [0, 0, 1], radius = -1 }]": RangeError,
    "shapes = [{ link = 'l', a = [0, 0, 0], b = [0, 0, 1], radius = 1, colour = 2 }]": UnknownNameError,
}


def test_a_full_row(tmp_path: Path) -> None:
    (tmp_path / "x.toml").write_text(
        GOOD + "about = 'An arm'\nbase = 'planar'\nlock = { 'f*' = 0.1 }\nsrdf = 's'\nstate = 'home'\n"
        "neutral = { j = 1 }\nframes = { tip = 't' }\nacceleration = { j = 2 }\nsource = 'maker'\n"
        "mimic_leaders = { a = 'b' }\nshapes = [{ link = 'l', a = [0, 0, 0], b = [0, 0, 2], radius = 1 }]\n"
    )
    (recipe,) = read_table(tmp_path).values()
    assert (recipe.name, recipe.base, recipe.lock, recipe.neutral) == ("arm", "planar", {"f*": 0.1}, {"j": 1.0})
    shape = recipe.shapes[0].placed()
    assert (shape.shape.radius, shape.shape.length, shape.excess) == (1.0, 2.0, 0.0)


@pytest.mark.parametrize("line", BAD)
def test_broken_rows(tmp_path: Path, line: str) -> None:
    (tmp_path / "x.toml").write_text(GOOD + line + "\n")
    with pytest.raises(WbcError) as caught:
        read_table(tmp_path)
    assert type(caught.value) is BAD[line]
    assert "x.toml" in caught.value.field or caught.value.field.startswith("lock")


def test_broken_files(tmp_path: Path) -> None:
    (tmp_path / "x.toml").write_text("[arm\n")
    with pytest.raises(RobotFileError, match=r"x\.toml"):
        read_table(tmp_path)
    (tmp_path / "x.toml").write_text("arm = 3\n")
    with pytest.raises(ShapeError, match="expected a table"):
        read_table(tmp_path)
    (tmp_path / "x.toml").write_text("[arm]\nabout = 'no file'\n")
    with pytest.raises(ShapeError, match="file"):
        read_table(tmp_path)
    (tmp_path / "x.toml").write_text(GOOD)
    (tmp_path / "y.toml").write_text(GOOD)
    with pytest.raises(DuplicateNameError, match="arm"):
        read_table(tmp_path)
