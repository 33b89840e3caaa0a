"""``wbc robots pairs NAME`` as a user types it."""

from __future__ import annotations

from pathlib import Path

import wbc.robots
from tests.cli.test_commands import run


def rows(text: str) -> list[list[str]]:
    return [line.split() for line in text.splitlines()]


def test_shapes_and_pairs_are_listed() -> None:
    code, out, err = run("robots", "pairs", "ur5", "--samples", "500")
    assert (code, err) == (0, "")
    lines = rows(out)
    assert ["forearm_link", "capsule", "radius", "64.2,", "length", "388.7", "37.9"] in lines
    pairs = {(row[0], row[1]): row[2:] for row in lines if len(row) > 3 and row[2] in ("kept", "dropped")}
    assert len(pairs) == 28
    assert pairs["base_link", "shoulder_link"][:2] == ["dropped", "adjacent"]
    assert pairs["base_link", "upper_arm_link"][:2] == ["dropped", "srdf"]
    assert pairs["base_link", "wrist_2_link"][:2] == ["kept", "touches"]
    assert pairs["wrist_1_link", "ee_link"] == ["dropped", "never", "46.8"]
    assert "15 of 28 pairs kept (500 configurations, seed 0, clearance 0 mm)" in out


def test_pairs_are_saved_edited_and_shown(tmp_path: Path) -> None:
    file = tmp_path / "pairs.toml"
    code, _, err = run("robots", "pairs", "panda", "--samples", "50", "--save", file)
    assert code == 0
    assert "written to" in err
    kept = wbc.robots.read_self_pairs(file, wbc.robots.load("panda")).kept
    edited = file.read_text().replace("keep = true,", "keep = false,", 1)
    file.write_text(edited)
    code, out, _ = run("robots", "pairs", "panda", "--pairs", file)
    assert code == 0
    assert f"{len(kept) - 1} of 55 pairs kept (50 configurations" in out
    code, _, err = run("robots", "pairs", "panda", "--samples", "50", "--save", file)
    assert code == 2
    assert "perhaps edited by hand" in err
    assert file.read_text() == edited
    code, _, _ = run("robots", "pairs", "panda", "--samples", "50", "--save", file, "--force")
    assert code == 0
    assert file.read_text() != edited


def test_an_srdf_file_and_exact_shapes(tmp_path: Path) -> None:
    (tmp_path / "r.srdf").write_text(
        '<robot name="r"><disable_collisions link1="LF_FOOT" link2="RF_FOOT" reason="User"/>'
        '<disable_collisions link1="LF_FOOT" link2="gone"/></robot>'
    )
    code, out, _ = run(
        "robots", "pairs", "anymal_b", "--shapes", "exact", "--samples", "0", "--srdf", tmp_path / "r.srdf"
    )
    assert code == 0
    assert ["LF_FOOT", "RF_FOOT", "dropped", "srdf:", "User", "-"] in rows(out)
    assert "box" in out
    assert "the SRDF file also names gone" in out
