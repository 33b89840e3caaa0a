"""The table's files are checked field by field."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.refusals import assert_refused
from wbc import errors
from wbc.robot.sources.table import read_table

GOOD = '[arm]\nfile = "a/b.urdf"\n'
BAD = {
    'colour = "red"': errors.UnknownNameError,
    'name = "x"': errors.UnknownNameError,
    'base = "flaoting"': errors.UnknownNameError,
    "about = 3": errors.ShapeError,
    'about = ""': errors.ShapeError,
    "lock = 3": errors.ShapeError,
    "lock = { j = nan }": errors.NotFiniteError,
    "frames = ['tip']": errors.ShapeError,
    "frames = { tip = 3 }": errors.ShapeError,
    'neutral = { j = "x" }': errors.ShapeError,
    "acceleration = { j = -1.0 }\nsource = 's'": errors.RangeError,
    "acceleration = { j = 1.0 }": errors.RangeError,
    "source = 's'": errors.RangeError,
    "state = 'home'": errors.RangeError,
    "shapes = 3": errors.ShapeError,
    "shapes = [{ link = 'l', a = [0, 0, 0] }]": errors.ShapeError,
    "shapes = [{ link = 'l', a = [0, 0], b = [0, 0, 1], radius = 1 }]": errors.ShapeError,
    "shapes = [{ link = 'l', a = [0, 0, 0], b = [0, 0, 1], radius = -1 }]": errors.RangeError,
    "shapes = [{ link = 'l', a = [0, 0, 0], b = [0, 0, 1], radius = 1, colour = 2 }]": errors.UnknownNameError,
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
    with pytest.raises(errors.WbcError) as caught:
        read_table(tmp_path)
    assert type(caught.value) is BAD[line]
    assert "x.toml" in caught.value.field or caught.value.field.startswith("lock")


def test_broken_files(tmp_path: Path) -> None:
    (tmp_path / "x.toml").write_text("[arm\n")
    assert_refused(lambda: read_table(tmp_path), errors.RobotFileError, "x.toml")
    (tmp_path / "x.toml").write_text("arm = 3\n")
    assert_refused(lambda: read_table(tmp_path), errors.ShapeError, "expected a table")
    (tmp_path / "x.toml").write_text("[arm]\nabout = 'no file'\n")
    assert_refused(lambda: read_table(tmp_path), errors.ShapeError, "file")
    (tmp_path / "x.toml").write_text(GOOD)
    (tmp_path / "y.toml").write_text(GOOD)
    assert_refused(lambda: read_table(tmp_path), errors.DuplicateNameError, "arm")
