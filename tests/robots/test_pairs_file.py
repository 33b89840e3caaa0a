"""The file of pairs: written, read, edited by hand, and refused where it is wrong."""

from __future__ import annotations

from pathlib import Path

import pytest

import wbc.robot.sources.table
import wbc.robots
from wbc.errors import (
    DuplicateNameError,
    NotFiniteError,
    RangeError,
    RobotFileError,
    ShapeError,
    UnknownNameError,
    WbcError,
)
from wbc.robot import Robot
from wbc.robot.pairs.collision_pairs import LinkPair, SelfPairs
from wbc.robots import catalogue

PAIR = '{ links = ["forearm_link", "base_link"], keep = true }'
BAD = {
    "pairs = 3": (ShapeError, "p.toml pairs"),
    "robot = 'ur5'": (ShapeError, "p.toml pairs"),
    "pairs = []\nsampels = 3": (UnknownNameError, "did you mean 'samples'"),
    "pairs = []\nsamples = 1.5": (ShapeError, "samples"),
    "pairs = []\nseed = -1": (RangeError, "seed"),
    "pairs = []\nclearance = nan": (NotFiniteError, "clearance"),
    "pairs = []\nrobot = 3": (ShapeError, "robot"),
    "pairs = [3]": (ShapeError, "pairs[0]"),
    "pairs = [{ keep = true }]": (ShapeError, "pairs[0] links"),
    "pairs = [{ links = ['ee_link'], keep = true }]": (ShapeError, "line 1 pairs[0] links"),
    "pairs = [\n{ links = ['ee_link', 'base_lnik'], keep = true }]": (
        UnknownNameError,
        "line 2 pairs[0] links: unknown name, did you mean 'base_link'?",
    ),
    "pairs = [{ links = ['ee_link', 'tool0'], keep = true }]": (UnknownNameError, "links"),  # a frame without shapes
    "pairs = [{ links = ['ee_link', 3], keep = true }]": (UnknownNameError, "links"),
    "pairs = [{ links = ['ee_link', 'ee_link'], keep = true }]": (DuplicateNameError, "links"),
    f"pairs = [\n{PAIR},\n{{ links = ['base_link', 'forearm_link'], keep = false }}]": (
        DuplicateNameError,
        "pairs[1] links",
    ),
    "pairs = [{ links = ['ee_link', 'base_link'] }]": (ShapeError, "keep"),
    "pairs = [{ links = ['ee_link', 'base_link'], keep = 1 }]": (ShapeError, "keep"),
    "pairs = [{ links = ['ee_link', 'base_link'], keep = true, why = 'x' }]": (UnknownNameError, "pairs[0]"),
    "pairs = [{ links = ['ee_link', 'base_link'], keep = true, reason = 'nver' }]": (UnknownNameError, "'never'"),
    "pairs = [{ links = ['ee_link', 'base_link'], keep = true, distance = inf }]": (NotFiniteError, "distance"),
    "pairs = [{ links = ['ee_link', 'base_link'], keep = true, distance = 'far' }]": (ShapeError, "distance"),
    "pairs = [{ links = ['ee_link', 'base_link'], keep = true, detail = 3 }]": (ShapeError, "detail"),
    "pairs = [}]": (RobotFileError, "line 1"),
}


@pytest.fixture(scope="module")
def ur5() -> Robot:
    return wbc.robots.load("ur5")


def test_round_trip(ur5: Robot, tmp_path: Path) -> None:
    found = wbc.robots.find_self_pairs(ur5, samples=100, clearance=0.01, seed=4)
    wbc.robots.save_self_pairs(found, tmp_path / "p.toml")
    read = wbc.robots.read_self_pairs(tmp_path / "p.toml", ur5)
    assert (read.samples, read.seed, read.clearance) == (100, 4, 0.01)
    for ours, theirs in zip(found.pairs, read.pairs, strict=True):
        assert (ours.links, ours.keep, ours.reason, ours.detail) == (
            theirs.links,
            theirs.keep,
            theirs.reason,
            theirs.detail,
        )
        assert theirs.distance == pytest.approx(ours.distance, abs=5.1e-5)
    wbc.robots.save_self_pairs(read, tmp_path / "q.toml")
    assert (tmp_path / "q.toml").read_text() == (tmp_path / "p.toml").read_text()


def test_odd_names_survive(ur5: Robot, tmp_path: Path) -> None:
    odd = 'a "quoted"\\ name\n'
    robot = ur5.with_frame(odd, "ee_link")
    robot = robot.with_shapes({odd: ur5.shapes["ee_link"], "base_link": ur5.shapes["base_link"]})
    found = SelfPairs(odd, (LinkPair((odd, "base_link"), True, "hand", None, odd),))
    wbc.robots.save_self_pairs(found, tmp_path / "p.toml")
    read = wbc.robots.read_self_pairs(tmp_path / "p.toml", robot)
    assert read.kept == ((odd, "base_link"),)
    assert read.pairs[0].detail == odd


def test_edited_by_hand(ur5: Robot, tmp_path: Path) -> None:
    file = tmp_path / "p.toml"
    file.write_text(f"# mine\npairs = [\n  {PAIR},  # the worst one\n]\n")
    read = wbc.robots.read_self_pairs(file, ur5)
    assert read.kept == (("forearm_link", "base_link"),)
    assert read.counts() == {"unlisted": 27, "hand": 1}
    assert ur5.with_self_pairs(read.kept).self_pairs == (("forearm_link", "base_link"),)
    kept = wbc.robots.read_self_pairs(Path(catalogue.__file__).parent / "pairs" / "ur5.toml", ur5)
    wbc.robots.save_self_pairs(kept, file)
    line = next(line for line in file.read_text().splitlines() if "wrist_1_link" in line and "keep = true" in line)
    file.write_text(file.read_text().replace(line, line.replace("keep = true", "keep = false")))
    assert len(wbc.robots.read_self_pairs(file, ur5).kept) == len(kept.kept) - 1


@pytest.mark.parametrize("text", BAD)
def test_bad_files(text: str, ur5: Robot, tmp_path: Path) -> None:
    file = tmp_path / "p.toml"
    file.write_text(text)
    kind, words = BAD[text]
    with pytest.raises(WbcError) as caught:
        wbc.robots.read_self_pairs(file, ur5)
    assert type(caught.value) is kind
    assert "p.toml" in str(caught.value)
    assert words in str(caught.value)


def test_missing_and_unwritable_files(ur5: Robot, tmp_path: Path) -> None:
    with pytest.raises(RobotFileError, match=r"gone\.toml"):
        wbc.robots.read_self_pairs(tmp_path / "gone.toml", ur5)
    with pytest.raises(RobotFileError, match="cannot be written"):
        wbc.robots.save_self_pairs(SelfPairs("x", ()), tmp_path / "no" / "p.toml")


@pytest.mark.parametrize("line", ['pairs = "pairs/x.toml"', 'srdf = "a.srdf"\nstate = "home"\npairs = 3'])
def test_pairs_in_the_table_need_shapes(line: str, tmp_path: Path) -> None:
    (tmp_path / "x.toml").write_text(f'[arm]\nfile = "a/b.urdf"\n{line}\n')
    with pytest.raises((RangeError, ShapeError), match="pairs"):
        wbc.robot.sources.table.read_table(tmp_path)
