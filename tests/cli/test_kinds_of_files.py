"""A file of another kind than a command wants is refused with what it is and which command takes it."""

from __future__ import annotations

from pathlib import Path

import pytest

import wbc
from tests.cli.test_commands import run
from wbc.formats import convert
from wbc.trajectory import jerk_limited

#: Texts by the name of a file
TEXTS = {
    "arm.urdf": '<robot name="arm"><link name="a"/></robot>', "arm.xml": "<mujoco><worldbody/></mujoco>",
    "cut.mcap": "\x89MCAP0\r\n", "walk.bvh": "HIERARCHY\nROOT a\n", "study.yaml": "scenario: reach\n",
    "pairs.toml": '# pairs\n[[pairs]]\nlinks = ["a", "b"]\n', "path.csv": "t, x, y, z\n0, 1, 2, 3\n",
    "bad.csv": "x,y,z\n1,2,a\n", "orders.csv": "time,pair,r1\n", "program.yaml": "# a program\nsteps:\n",
    "notes.txt": "nothing\n",
}  # fmt: skip
ROBOT = "robot description, for wbc robots show, the ROBOT of a command"
#: Arguments, and what is said of the file, "" for nothing
REFUSED = [
    (("view", "cut.mcap"), "cut.mcap is an MCAP recording, for Foxglove, wbc.formats.read_motion"),
    (("view", "law.npz"), "law.npz is a law of motion, for wbc.trajectory.load"),
    (("robots", "show", "ticks.npz"), "ticks.npz is a recording of ticks, for wbc replay, wbc view, wbc convert"),
    (("ik", "panda", "--targets", "arm.xml"), f"arm.xml is a {ROBOT}"),
    (("ik", "arm.urdf", "--targets", "cut.mcap"), "cut.mcap is an MCAP recording"),
    (("walk", "check", "arm.urdf"), f"arm.urdf is a {ROBOT}"),
    (("walk", "compare", "law.npz", "law.npz"), "law.npz is a law of motion"),
    (("walk", "--plan", "ticks.npz"), "ticks.npz is a recording of ticks"),
    (("replay", "law.npz"), "law.npz is a law of motion"),
    (("replay", "run.npz"), "run.npz is a log of a run, for wbc convert, wbc.log.load"),
    (("convert", "walk.bvh"), "walk.bvh is a clip of motion, for wbc retarget"),
    (("plan", "runs", "--to", "1"), "runs is the folder of a run, for wbc replay, wbc view, wbc convert"),
    (("study", "--resume", "runs"), "runs is the folder of a run"),
    (("coordinates", "drive", "spherical_4r", "--rates", "path.csv"), "is a path of waypoints, for wbc track --path"),
    (("walk", "--robot", "hexapod", "--scene", "study.yaml"), "study.yaml is a study, for wbc study"),
    (("robots", "pairs", "ur5", "--pairs", "program.yaml"), "program.yaml is a program of steps, for wbc.program"),
    (("robots", "pairs", "ur5", "--srdf", "arm.urdf"), f"as a URDF file (got 'arm.urdf'); arm.urdf is a {ROBOT}"),
    (("robots", "show", "arm.xml"), ""), (("ik", "panda", "--targets", "bad.csv"), ""),
    (("ik", "arm.urdf", "--target", "1,2"), ""), (("replay", "notes.txt"), ""), (("view", "program.yml"), ""),
    (("coordinates", "drive", "spherical_4r", "--rates", "orders.csv"), ""),
]  # fmt: skip


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """One of every kind."""
    made = tmp_path_factory.mktemp("kinds")
    for name, text in TEXTS.items():
        (made / name).write_bytes(text.encode("latin-1"))
    jerk_limited([0.0], [1.0], velocity=1.0, acceleration=1.0, jerk=1.0).save(made / "law.npz")
    stack = wbc.Stack(wbc.robots.load("ur5", shapes="none"), dt=0.01).add(wbc.tasks.Posture(), name="posture")
    (made / "runs").mkdir()
    for file in (made / "ticks.npz", made / "runs" / "ticks.npz"):
        controller = stack.compile(backend="vm")
        with controller.record(file):
            controller.step(stack.robot.neutral)
    convert(made / "ticks.npz", "npz", made / "run.npz")
    return made


@pytest.mark.parametrize(("arguments", "said"), REFUSED, ids=lambda x: "_".join(x) if isinstance(x, tuple) else "")
def test_what_it_is_and_what_takes_it(
    arguments: tuple[str, ...], said: str, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(folder)
    code, _, err = run(*arguments)
    assert code == 2
    assert err.count("\n") == 1
    assert said in err
    assert (", for " in err.partition("(got")[2]) == bool(said)
