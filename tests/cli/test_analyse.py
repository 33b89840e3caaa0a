"""``wbc coordinates analyse`` as a user types it."""

from __future__ import annotations

import functools
import json
import signal
import subprocess
import sys
import time
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from tests.cli.test_commands import run as wbc_command
from tests.processes import IN_BACKGROUND
from tests.repeats import ALL, MORE, repeats
from tests.slow import spent
from wbc import robots
from wbc.analysis import BodyRows, ExactModel, JointRows, certify
from wbc.cli.app import app

run = functools.partial(wbc_command, "coordinates", "analyse")


def test_published_set_on_screen_and_in_a_file(tmp_path: Path) -> None:
    file = tmp_path / "loci.json"
    code, out, _ = run("spherical_4r", "--set", "alpha", "--set", "alpha, beta", "--data", file)
    assert code == 0
    assert "alpha: 4 x 4, incomplete" in out
    assert "det      L3 L4 c2 s4 (L3^2 + 2 L3 L4 c4 + L4^2)" in out
    assert "alpha, beta: 5 x 4, loose" in out
    assert "locus    q2 = +-pi/2" in out
    assert "witness  q = " in out
    data = json.loads(file.read_text())
    assert [s["verdict"] for s in data["sets"]] == ["incomplete", "loose"]
    assert data["sets"][1]["locus"] == ["q4 = 0", "q4 = pi"]
    assert data["sets"][1]["latex"] == [r"q_{4} \in \{0, \pi\}"]


def test_a_set_of_ones_own(tmp_path: Path) -> None:
    code, out, _ = run("ssrms_simplified", "--lock", "joint1", "--latex")
    assert code == 0
    assert r"q_{6} = \pm\pi/2" in out
    assert "joint1: 7 x 7, incomplete" in out


def test_joints_by_their_names_and_times_that_say_what_they_are(tmp_path: Path) -> None:
    """A point near the tip of the Panda, and q1 ... in formulas are its joints."""
    file = tmp_path / "loci.json"
    code, out, _ = run("panda", "--frame", "panda_link7", "--point", "panda_link5", "--data", file)
    assert code == 0
    assert "joints: q1 = panda_joint1, q2 = panda_joint2, " in out
    assert "panda_link5: 9 x 7, incomplete, " in out
    assert " s by the clock, " in out
    assert " s of processor time" in out
    assert "everywhere" not in out
    (found,) = json.loads(file.read_text())["sets"]
    assert found["joints"]["q7"] == "panda_joint7"
    assert "q2 = 0" in found["locus"]


def test_angles_are_solved_for_in_printed_loci() -> None:
    code, out, _ = run("ssrms", "--point", "F5", "--lock", "joint1")
    assert code == 0
    assert "locus    q6 = +-pi/2 and q3 = q5 and q4 = pi - 2 q5" in out
    assert "tan(q3/2)" not in out


def test_minutes_are_kept_where_the_locus_takes_long() -> None:
    """The elbow alone on the Space Station arm: what is open is said, or a witness ends the question."""
    began = spent()
    code, out, _ = run("ssrms", "--point", "end3", "--minutes", 0.02)
    assert code == 0
    # 1.2 s
    assert spent() - began < 20.0
    assert "end3: 9 x 7, " in out
    assert "  open     " in out or "end3: incomplete" in out


def eight_joints(file: Path, axes: Sequence[np.ndarray], places: Sequence[np.ndarray]) -> Path:
    """A chain of turning joints j1 ... about axes and at places in the links l0 ... before them."""
    text = '<link name="l0"/>'
    for k, (axis, at) in enumerate(zip(axes, places, strict=True)):
        text += f'<link name="l{k + 1}"/><joint name="j{k + 1}" type="continuous"><parent link="l{k}"/>'
        text += f'<child link="l{k + 1}"/><origin xyz="{at[0]} {at[1]} {at[2]}"/>'
        text += f'<axis xyz="{axis[0]} {axis[1]} {axis[2]}"/></joint>'
    file.write_text(f'<robot name="eight">{text}</robot>')
    return file


@pytest.mark.parametrize("seed", range(18, 18 + repeats(1)))
def test_minutes_count_formulas(seed: int, tmp_path: Path) -> None:
    """Eight joints about coordinate axes: of the first seed branches are found soon, and writing them takes minutes."""
    rng, axes, places = np.random.default_rng(seed), [], []
    for _ in range(8):
        axes.append(np.eye(3)[rng.integers(3)])
        places.append(np.round(rng.uniform(-0.4, 0.4, 3) * (rng.random(3) < 0.5), 2))
    file = eight_joints(tmp_path / "eight.urdf", axes, places)
    began = spent()
    code, out, _ = run(file, "--approximate", "--frame", "l8", "--lock", "j5", "--lock", "j8", "--minutes", 0.06)
    assert code == 0
    assert "j5, j8: 8 x 8" in out
    assert seed != 18 or "formulas were not written within the minutes" in out
    # 3.6 s
    assert spent() - began < 9.0


@pytest.mark.parametrize("seed", range(repeats(2)))
def test_minutes_are_kept_where_the_jacobian_takes_long(seed: int, tmp_path: Path) -> None:
    """Eight joints about axes that are nobody's: their exact Jacobian alone takes a minute. That is said after 1.2 s,
    and a certificate says that nothing is decided.
    """
    rng = np.random.default_rng(seed)
    file = eight_joints(tmp_path / "eight.urdf", rng.normal(size=(8, 3)), rng.uniform(-0.4, 0.4, (8, 3)))
    began = spent()
    code, out, err = run(file, "--approximate", "--frame", "l8", "--lock", "j1", "--lock", "j5", "--minutes", 0.02)
    assert code == 2
    assert "minutes: expected more: the exact Jacobian of 8 joints takes longer (got 0.02)" in out + err
    model = ExactModel(robots.load(str(file)), approximate=True)
    found = certify(model, (BodyRows("l8"),), (JointRows("j1"), JointRows("j5")), minutes=0.02)
    assert found.verdict == "undecided"
    # 2.4 s
    assert spent() - began < 15.0


def test_certificate_on_screen_and_gone_on_with(tmp_path: Path) -> None:
    arguments = ("spherical_4r", "--set", "elbow, beta", "--certify", "--resume", tmp_path / "states")
    for _ in range(2):
        code, out, _ = run(*arguments)
        assert code == 0
        assert "elbow, beta: 7 x 4, loose" in out
        assert "certificate  complete outside the tube sigma_min(J_T) < 0.0077" in out
        assert "undecided 0" in out
    assert [p.name for p in (tmp_path / "states").iterdir()] == ["spherical_4r-elbow-beta.npz"]
    code, out, _ = run("spherical_4r", "--screen", 1)
    assert code == 0
    assert "no set of 1 or fewer constraints is complete" in out


def test_a_screen_ends_at_its_minutes() -> None:
    code, out, _ = run("ssrms", "--screen", 3, "--minutes", 1e-5)
    assert code == 0
    assert "screen: ended after 1e-05 min, before all sets were looked at" in out
    assert "is complete" not in out


def test_pictures_of_a_locus(tmp_path: Path) -> None:
    code, out, _ = run("spherical_4r", "--set", "alpha", "--plot", tmp_path)
    assert code == 0
    assert out.count("written") == 4
    names = {"spherical_4r-alpha.txt", "spherical_4r-alpha.tex"}
    names |= {"spherical_4r-alpha-locus.png", "spherical_4r-alpha-poses.png"}
    assert {p.name for p in tmp_path.iterdir()} == names
    assert "q2 = +-pi/2" in (tmp_path / "spherical_4r-alpha.txt").read_text()
    assert r"q_{2} = \pm\pi/2" in (tmp_path / "spherical_4r-alpha.tex").read_text()
    # A picture has something on it: many different bytes
    assert all(p.stat().st_size > 5_000 for p in tmp_path.glob("*.png"))


def test_a_whole_tree_by_blocks(tmp_path: Path) -> None:
    file = tmp_path / "tree.json"
    code, out, _ = run("spdm_on_ssrms", "--set", "arms alpha", "--data", file, "--plot", tmp_path / "pictures")
    assert code == 0
    # locus and poses of the carrier and of each arm; the body's joint never loses rank
    assert len([p for p in (tmp_path / "pictures").glob("*.png") if p.stat().st_size > 5_000]) == 6
    assert "arms alpha: 26 x 22, incomplete" in out
    assert "block    arm2_joint1 ... arm2_joint7: 7 x 7, loses rank" in out
    assert "block    body_joint: 1 x 1, strict" in out
    assert "carrier_joint1 ... carrier_joint7 loses rank" in out
    (found,) = json.loads(file.read_text())["sets"]
    assert [b["shape"] for b in found["blocks"]] == [[11, 7], [1, 1], [7, 7], [7, 7]]
    assert len(found["blocks"][0]["locus"]) == 8
    assert len(found["witness"]["q"]) == 22


def test_both_arms_of_the_dexterous_manipulator(tmp_path: Path) -> None:
    """`spdm` is one arm, as in the source; with --tree it is all 15 joints."""
    file = tmp_path / "tree.json"
    code, out, _ = run("spdm", "--tree", "--data", file)
    assert code == 0
    assert "alpha, q1, q7, elbow: 25 x 15, strict" in out
    assert "alpha: 15 x 15, incomplete" in out
    full, _ = json.loads(file.read_text())["sets"]
    assert sorted(b["shape"] for b in full["blocks"]) == [[1, 1], [12, 7], [12, 7]]


def test_a_whole_tree_is_certified_by_blocks(tmp_path: Path) -> None:
    """22 joints; the arms are alike and share a certificate."""
    file, states = tmp_path / "tree.json", tmp_path / "states"
    options = ("--set", "elbow, q1, q2, q7", "--certify", "--resume", states, "--data", file)
    code, out, _ = run("spdm_on_ssrms", *options)
    assert code == 0
    assert "certificate  complete everywhere, by blocks" in out
    (found,) = json.loads(file.read_text())["sets"]
    assert found["verdict"] == "strict"
    proof = found["certificate"]
    assert (proof["verdict"], proof["everywhere"], proof["left"], proof["witness"]) == ("complete", True, 0.0, None)
    assert [b["everywhere"] for b in proof["blocks"]] == [True] * 4
    assert [b["boxes"] > 0 for b in proof["blocks"]] == [True, False, True, True]
    assert len(list(states.iterdir())) == 2


#: The command, with every piece of the subdivision slowed so that there is time to interrupt it
CHILD = """
import sys, time
from pathlib import Path
from wbc.analysis.certificates.boxes import BoxSearch
from wbc.cli import main

run, begun = BoxSearch.run, Path(sys.argv[1])

def slow(self, boxes, budget):
    if budget >= 1000:
        begun.touch()
        time.sleep(0.3)
    return run(self, boxes, budget)

BoxSearch.run = slow
del sys.argv[1]
main()
"""


@pytest.mark.parametrize("background", [False, True] if MORE >= ALL else [False])
def test_a_certificate_interrupted_as_a_process_is_gone_on_with(background: bool, tmp_path: Path) -> None:
    """SIGINT while boxes are looked at: what is known is told and kept, and the rest is done by the next call. In the
    background of a shell that ignores SIGINT the same with SIGTERM.
    """
    begun, states = tmp_path / "begun", tmp_path / "states"
    command = ["coordinates", "analyse", "spherical_4r", "--set", "elbow, beta"]
    command += ["--certify", "--resume", str(states), "--data"]
    cut, whole = tmp_path / "cut.json", tmp_path / "whole.json"
    child = subprocess.Popen(
        [*(IN_BACKGROUND if background else ()), sys.executable, "-c", CHILD, str(begun), *command, str(cut)],
        stdout=subprocess.PIPE,
        text=True,
    )
    until = time.monotonic() + 60.0
    while not begun.exists():
        assert child.poll() is None
        assert time.monotonic() < until
        time.sleep(0.02)
    child.send_signal(signal.SIGINT)
    if background:
        child.send_signal(signal.SIGTERM)
    told, _ = child.communicate(timeout=60.0)
    assert child.returncode == 0
    assert "certificate  undecided" in told
    first = json.loads(cut.read_text())["sets"][0]["certificate"]
    assert first["verdict"] == "undecided"
    assert 0.0 < first["left"] < 1.0
    (kept,) = states.iterdir()
    assert CliRunner().invoke(app, [*command, str(whole)]).exit_code == 0
    assert CliRunner().invoke(app, ["coordinates", *command[1:6], "--data", str(cut)]).exit_code == 0
    resumed, fresh = (json.loads(file.read_text())["sets"][0]["certificate"] for file in (whole, cut))
    assert resumed["verdict"] == fresh["verdict"] == "complete"
    assert resumed["left"] == fresh["left"] == 0.0
    assert resumed["boxes"] == pytest.approx(fresh["boxes"])
    assert kept.exists()
