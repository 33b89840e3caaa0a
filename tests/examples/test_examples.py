"""Every example runs without a display and prints what it promises."""

from __future__ import annotations

import ast
import contextlib
import io
import os
import re
import runpy
import subprocess
import sys
from pathlib import Path

import matplotlib.pyplot as plt
import pytest
from matplotlib.image import imread

from wbc.native import toolchain
from wbc.track import render, scene

FOLDER = Path(__file__).parents[2] / "examples"
EXAMPLES = sorted(FOLDER.glob("*.py"))
NUMBER = r"([-+0-9.e]+)"


#: Examples that run without a compiler, as on a machine that has none
WITHOUT_COMPILER = ("quick_start", "conflict")


def output(name: str) -> str:
    """What the example prints, as a script of this process."""
    with pytest.MonkeyPatch.context() as patch, contextlib.redirect_stdout(io.StringIO()) as said:
        # As small as can be looked at by a test
        patch.setattr(scene, "SUPERSAMPLING", 1)
        patch.setattr(render, "SHADOW_MAP", 300)
        if name in WITHOUT_COMPILER:
            patch.setattr(toolchain, "missing", lambda: ("no C compiler",))
        runpy.run_path(str(FOLDER / f"{name}.py"), run_name="__main__")
    plt.close("all")
    return said.getvalue()


def test_an_example_is_a_script() -> None:
    """In a process of its own, without a compiler."""
    command = [sys.executable, str(FOLDER / "quick_start.py")]
    done = subprocess.run(command, capture_output=True, text=True, check=False, env={**os.environ, "WBC_CC": ""})
    assert done.returncode == 0, done.stderr
    assert done.stdout == output("quick_start")


@pytest.fixture(autouse=True)
def _elsewhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Pictures go into the folder that an example runs in."""
    monkeypatch.chdir(tmp_path)


def check_picture(text: str) -> None:
    """The file that is named last is a picture, with something in its middle and nothing but white at its corners."""
    pixels = imread(text.splitlines()[-1])[..., :3]
    height, width = pixels.shape[:2]
    assert pixels[height // 4 : -height // 4, width // 4 : -width // 4].std() > 0.05
    for corner in (pixels[:20, :20], pixels[:20, -20:], pixels[-20:, :20]):
        assert corner.min() > 0.8


def number(pattern: str, text: str) -> float:
    found = re.search(pattern.replace("#", NUMBER), text)
    assert found is not None, text
    return float(found.group(1))


def test_quick_start_follows() -> None:
    text = output("quick_start")
    assert "(vm)" in text
    assert number("solved, hand error # mm", text) < 0.1


def test_custom_expression_looks_at_the_point() -> None:
    text = output("custom_expression")
    errors = [float(x) for x in re.findall(rf"solved: look {NUMBER} mm", text)]
    assert len(errors) == 2
    assert max(errors) < 5.0
    assert min(float(x) for x in re.findall(rf"at least {NUMBER} m high", text)) > 0.549


def test_a_target_is_followed_past_a_moving_obstacle() -> None:
    text = output("moving_obstacle")
    assert number("beyond the margin # mm", text) > -0.5
    assert number("hand pushed # mm", text) > 20.0
    assert number("at the end: solved, hand error # mm", text) < 0.1


def test_a_peg_goes_in_where_the_hole_is_measured() -> None:
    said = output("insert")
    assert "measured: False  failed" in said
    assert "measured: True   succeeded" in said
    assert said.count("retreat") == 2


def test_moving_table_is_followed() -> None:
    still, followed = (float(x) for x in re.findall(rf"table's frame {NUMBER} mm", output("moving_table")))
    assert followed < 1.0 < 50.0 < still


def test_humanoid_reaches_on_held_feet() -> None:
    text = output("humanoid")
    assert number("solved: hand # mm", text) < 1.0
    # Its margin is 20 mm, and binds
    assert number("centre of mass at least # mm", text) == pytest.approx(20.0, abs=0.2)
    assert number("left foot moved # um", text) < 1.0


def test_dual_arm_carries_the_box() -> None:
    text = output("dual_arm")
    assert number("solved: box at most # mm", text) < 0.5
    assert number("at most # mm apart", text) < 0.25


def test_own_files_load_and_arrive() -> None:
    assert max(float(x) for x in re.findall(rf"solved: {NUMBER} mm", output("own_urdf"))) < 0.1
    assert number("MuJoCo has the tool # mm", output("own_mjcf")) < 0.2


def test_servos_of_mujoco_follow() -> None:
    text = output("mujoco_servo")
    assert number("tool # mm .median", text) < 1.0
    assert number("median., # mm", text) < 3.0


def test_a_quadruped_stands_on_three_feet() -> None:
    text = output("mujoco_quadruped")
    assert number("the fourth # mm above", text) > 140.0
    assert number("# mm from its target", text) < 3.0
    assert number("centre of mass # mm off", text) < 5.0
    assert "; 0 ticks relaxed" in text
    check_picture(text)


def test_an_ankle_and_a_delta_keep_their_loops() -> None:
    text = output("closed_loops")
    assert number("at most # degrees off", text) < 3.0
    assert number("plate at most # mm off", text) < 6.0
    assert "The linkage of arm0, arm1, arm2 is" in text
    assert number("loops open by at most # m", text) < 1e-9
    # 5 N m about the ankle by two rods 0.05 m behind it
    assert number("rods bear left # N", text) == pytest.approx(50.0, abs=15.0)
    check_picture(text)


def test_a_humanoid_is_pushed() -> None:
    text = output("mujoco_humanoid")
    assert number("hand # mm", text) < 5.0
    assert number("centre of mass by # mm", text) < 20.0
    assert number("# mm are left", text) < 3.0
    assert number("feet moved # mm", text) < 5.0
    assert "; 0 ticks relaxed" in text
    check_picture(text)


def test_a_person_drives_a_humanoid() -> None:
    assert number("hands at most # mm", output("retarget")) < 5.0


def test_a_browser_shows_an_arm(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "argv", ["drag.py", "--ticks", "20"])
    assert number("hand # mm", output("drag")) < 1e-3


def test_mobile_base_rolls_along_with_the_hand() -> None:
    text = output("mobile_base")
    assert number("solved: hand at most # mm", text) < 2.0
    assert number("wheels rolled # m", text) > 7.0
    assert number("slip at most # mm/s", text) < 1e-3


def test_clutter_is_not_touched() -> None:
    text = output("clutter")
    gaps = dict(re.findall(rf"(\w+): panda_\w+ came within {NUMBER} mm", text))
    assert set(gaps) == {"house", "box", "post", "bar", "ball"}
    # The margin is 15 mm; a tick of 20 ms bends the way by some tenths
    assert min(float(gap) for gap in gaps.values()) > 13.5
    # Four of five do hinder the arm
    assert sorted(float(gap) for gap in gaps.values())[3] < 20.0
    assert number("solved, hand # mm", text) < 1.0
    check_picture(text)


def test_self_collision_keeps_the_arms_apart() -> None:
    text = output("self_collision")
    assert number("without SelfCollision: least distance # mm", text) < -100.0
    assert number("with SelfCollision: least distance # mm", text) > 17.0
    off = [float(x) for x in re.findall(rf"solved, hands at most {NUMBER} mm", text)]
    assert len(off) == 2
    assert max(off) < 6.0
    check_picture(text)


@pytest.mark.usefixtures("as_users_get_them")
def test_time_laws_keep_their_limits() -> None:
    text = output("time_laws")
    fast, smooth = (line for line in text.splitlines() if re.match(r"(least time|jerk-limited) ", line))
    assert "jerk: unbounded" in fast
    # Used to the full, and no further
    for line, names in ((fast, ("velocity", "acceleration", "torque")), (smooth, ("velocity", "acceleration", "jerk"))):
        used = [number(f"{name} #", line) for name in names]
        assert 0.999 < max(used) <= 1.000001
    assert smooth.count("exact") == 4
    assert number("along the law: at most # um", text) < 1.5
    for name in ("time_laws", "time_laws_fast"):
        pixels = imread(f"runs/{name}.png")[..., :3]
        assert pixels.shape[0] > 800
        # Curves on white
        assert pixels.mean() > 0.8
        assert pixels.std() > 0.05


def test_walk_arrives_within_its_limits() -> None:
    text = output("walk")
    assert "arrived" in text
    assert number("body at most # mm/s", text) <= 101.6 * 1.01
    assert "VIOLATED" not in text
    assert number("largest joint rate # of", text) <= 1.000001


def test_levels_cost_the_hand_nothing() -> None:
    text = output("levels")
    found = re.search(rf"{NUMBER} mm off with levels, {NUMBER} mm off with weights", text)
    assert found
    assert float(found[1]) < 1.0 < 10.0 < float(found[2])
    assert all(float(x) < 1e-6 for x in re.findall(rf"disturbed {NUMBER}", text))


def test_space_arm_passes_where_single_pairs_fail() -> None:
    text = output("space_arm")
    for failing in ("joint2", "alpha"):
        assert number(f"(?m)^{failing}: tip loses at most # m/s", text) > 0.1
    assert number("alpha, beta: tip loses at most # m/s", text) < 1e-6
    assert number("alpha, beta: .* to # rad", text) > 1.75
    assert number("alpha, beta: .*acceleration at most # rad/s", text) <= 0.02 + 1e-6
    assert "pair at the end beta" in text
    check_picture(text)


def test_conflict_names_the_culprit() -> None:
    text = output("conflict")
    assert number("Cheapest to relax: ball/panda_hand.0. by # mm/s", text) == pytest.approx(536, abs=1)
    assert number("Cheapest to relax: grip/y by # mm/s", text) == pytest.approx(545, abs=1)
    assert number("hand misses # mm/s of 100 mm/s", text) == pytest.approx(80.7, abs=0.1)
    assert "The culprit: limits takes 80.4 mm/s from the hand, most of all limits/panda_joint3 upper" in text
    # The page quotes what the example prints
    page = (FOLDER.parent / "docs" / "explanations.md").read_text()
    worked = page.split("## Worked conflicts")[1].split("\n## ")[0]
    quoted = [line.strip() for line in worked.splitlines() if line[:4] == "    "]
    assert len(quoted) == 10
    assert [line for line in quoted if line not in text.splitlines()] == []


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda p: p.stem)
def test_examples_are_short_and_use_public_names(path: Path) -> None:
    text = path.read_text()
    assert text.count("\n") < 75
    tree = ast.parse(text)
    assert ast.get_docstring(tree)
    modules = {a.name for n in ast.walk(tree) if isinstance(n, ast.Import) for a in n.names}
    modules |= {n.module or "" for n in ast.walk(tree) if isinstance(n, ast.ImportFrom)}
    ours = {
        "wbc",
        "wbc.tasks",
        "wbc.track",
        "wbc.shapes",
        "wbc.trajectory",
        "wbc.climb",
        "wbc.climb.checker",
        "wbc.coordinates",
    }
    ours |= {"wbc.estimation", "wbc.program", "wbc.servo", "wbc.simulation"}
    assert modules <= {"itertools", "pathlib", "sys", "numpy", "pinocchio", "casadi", "mujoco"} | ours
    assert not [n.attr for n in ast.walk(tree) if isinstance(n, ast.Attribute) and n.attr.startswith("_")]


def test_every_example_is_run() -> None:
    called = set(re.findall(r'output\("(\w+)"\)', Path(__file__).read_text()))
    assert called == {path.stem for path in EXAMPLES}


def test_torque_wipes_with_ten_newtons() -> None:
    text = output("torque")
    assert number("force # N", text) == pytest.approx(10.0, abs=0.3)
    assert number("from # to", text) > 9.5
    assert number("error along the table # mm", text) < 1.0
    assert number("largest torque # %", text) < 100.0


def test_grips_bear_no_more_than_their_rating() -> None:
    text = output("grips")
    shares = [float(x) for x in re.findall(rf"bears at most {NUMBER} %", text)]
    assert shares[0] > 300.0
    assert shares[1] <= 100.0 + 1e-6
    assert text.count("solved") == 2
    assert max(float(x) for x in re.findall(rf"body {NUMBER} mm", text)) < 1.0
    assert max(float(x) for x in re.findall(rf"at most {NUMBER} um", text)) < 10.0
    check_picture(text)


def test_hands_squeeze_a_box_no_harder_than_it_takes() -> None:
    text = output("squeeze")
    assert "solved: each hand presses" in text
    assert number("presses with # to", text) > 30.0
    assert abs(number("at most # N more", text)) < 0.3
    assert number("hand at most # mm", text) < 0.5
    check_picture(text)
