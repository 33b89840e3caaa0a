"""What commands refuse: one line that names the option, exit code 2, and nothing written."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from tests.cli.test_commands import run

#: Options of an analysis that a tree does not take, and constraints of one's own that a screen does not
TREE = (("--screen", "2"), ("--approximate",), ("--full",))
SCREENED = (("--lock", "joint1"), ("--point", "end3"), ("--plane", "F3,F5"), ("--set", "q1"))
#: Files that are there, and what is in them
FILES = {
    "there.csv": "", "header.csv": "xx,y,z\n1,2,3\n", "short.csv": "x,y,z,qx\n1,2,3,1\n",
    "ragged.csv": "x,y,z\n1,2,3\n1,2\n", "words.csv": "x,y,z\n1,2,a\n", "text.npz": "no archive",
}  # fmt: skip
ARRAYS = {
    "other.npz": {"pose": np.zeros((1, 7))}, "shape.npz": {"poses": np.zeros((2, 6))},
    "nan.npz": {"positions": np.array([[0.4, 0.0, 0.5], [np.nan, 0.0, 0.0]])},
    "turn.npz": {"poses": np.ones((1, 4, 4)) * [[1], [1], [1], [0]] + np.diag([0, 0, 0, 1.0])},
}  # fmt: skip
#: Options of commands that do not name them
USUAL = {
    "track": {"--out": "run", "--backend": "vm", "--duration": "0.2", "--no-plots": ""},
    "walk": {"--out": "run"}, "export": {"--out": "run"},
}  # fmt: skip
REFUSED: list[tuple[list[str], str]] = [
    (["robots", "show", "pandda"], "robot: unknown name, did you mean 'panda'?"),
    (["ik", "none.urd", "--target", "0.4,0.2,0.5"], "robot: there is no such file"),
    (["track", "pandda"], "robot: unknown name, did you mean 'panda'?"),
    (["track", "--path", "circel"], "path: unknown name, did you mean 'circle'?"),
    (["track", "--path", "none.csv"], "path: there is no such file"),
    (
        ["view", "pandda"],
        "what: no robot has this name, and there is no such file or folder; did you mean 'panda'?",
    ),
    (
        ["view", "first"],
        "what: no robot has this name, and there is no such file or folder; did you mean 'first_'?",
    ),
    (["view", "none.urdf", "--export", "page.html"], "what: there is no such file or folder (got"),
    (["view", "ticks.npz"], "what: there is no such file or folder (got"),
    (["view", "first_/run"], "what: there is no such file or folder, did you mean 'first_/runs'?"),
    (["replay", "first_/run"], "recording: cannot be read: No such file or directory, did you mean 'first_/runs'?"),
    (["walk", "check", "first"], "run: there is no such folder, did you mean 'first_'?"),
    (["walk", "compare", "none.npz", "none.npz"], "plan: there is no such file"),
    (["study", "none.yaml"], "study: there is no such file"),
    (["study", "--resume", "first"], "resume: there is no such folder, did you mean 'first_'?"),
    (["ik", "ur5", "--targets", "none.csv"], "targets: there is no such file"),
    (["walk", "drive", "none.csv"], "rates: there is no such file"),
    (["track", "--frame", "panda_hand_tpc"], "did you mean 'panda_hand_tcp'?"),
    (["track", "--solver", "dapq"], "solver: unknown name, did you mean 'daqp'?"),
    (["track", "--backend", "nativ"], "backend: unknown name, did you mean 'native'?"),
    (["track", "--log", "parqet"], "log: unknown name, did you mean 'parquet'?"),
    (["track", "--plane", "swin"], "plane: unknown name, did you mean 'swing'?"),
    (["track", "--rate", "0"], "rate: expected a value in (0, inf] Hz"),
    (["track", "--rate", "nan"], "rate: expected finite numbers"),
    (["track", "--duration", "-1"], "duration: expected"),
    (["track", "--gain", "-1"], "gain"),
    (["track", "--margin", "-1"], "margin"),
    (["track", "--size", "0"], "size: expected"),
    (["track", "--sphere", "1,2,3"], "sphere: expected X,Y,Z,RADIUS"),
    (["track", "--sphere", "1,2,3,x"], "sphere: expected numbers"),
    (["track", "--sphere", "1,2,3,-1"], "radius"),
    (["track", "--start", "0,0"], "start: expected shape (7,)"),
    (["track", "--hold", "panda_link99"], "holds"),
    (["track", "double_pendulum", "--plane", "hold"], "knows no shoulder, elbow and wrist"),
    (["robots", "pairs", "kinova"], "no link of this robot has shapes"),
    (["robots", "pairs", "ur5", "--samples", "-1"], "samples: expected 0 or more"),
    (["robots", "pairs", "ur5", "--shapes", "ft"], "shapes: unknown name, did you mean 'fit'?"),
    (["robots", "pairs", "ur5", "--srdf", "gone.srdf"], "there is no such file"),
    (["robots", "pairs", "ur5", "--pairs", "gone.toml"], "pairs: cannot be read"),
    (["robots", "pairs", "ur5", "--pairs", "gone.toml", "--samples", "3"], "leave out --samples"),
    (["robots", "pairs", "ur5", "--samples", "0", "--save", "no/such/folder.toml"], "there is no such folder"),
    (["ik", "explore", "pnda"], "panda"),
    (["ik", "explore", "panda", "--kind", "place"], "position"),
    (["ik", "explore", "panda", "--rates", "1,2"], "shape"),
    (["ik", "explore", "panda", "--rates", "1,x"], "numbers"),
    (["ik", "explore", "panda", "--to", "1,2"], "X,Y,Z"),
    (["published", "ikor", "--case", "4"], "valid: 1, 2, 3"),
    (["published", "ikor", "--case", "1", "--resolver", "stack"], "consistent"),
    (["published", "ikor-run", "--line", "1,2"], "X,Y,Z"),
    (["published", "ikor-run", "--arc", "0,0,9", "--line", "1,2,3"], "expected one of"),
    (["published", "ikor-run", "--line", "-0.8,-0.3,0.6", "--film", "mov"], "gif"),
    (["published", "ikor-run", "--start", "1,2,3"], "expected one of"),
    (["published", "ikor-run", "--line", "1,2,3", "--start", "1,2"], "X,Y,Z"),
    (["published", "ikor-run", "--arc", "1,2"], "X,Y,DEGREES"),
    (["published", "ikor-run", "--line", "1,2,3", "--weights", "1,2"], "shape (7,)"),
    (["published", "ikor-run", "--line", "1,2,3", "--weights", "1,1,1,0,1,1,1"], "above 0"),
    (["published", "ikor-run", "--line", "1,2,3", "--criterion", "torqe"], "torque"),
    (["published", "ikor-run", "--line", "1,2,3", "--switch", "4"], "POINT:"),
    (["published", "ikor-run", "--line", "1,2,3", "--switch", "4:base=off"], "platform"),
    (["published", "ikor-run", "--line", "1,2,3", "--switch", "4:platform=of"], "off"),
    (["published", "ikor-run", "--trajectory", "no_such_file"], "no_such_file"),
    (["published", "ikor-run", "--robot", "hermes", "--trajectory", "x"], "hermes"),
    (["published", "relative-motion", "meassuring"], "did you mean 'measuring'"),
    (["published", "relative-motion", "measuring", "--angles", "1,2"], "4 numbers"),
    (["published", "relative-motion", "master-slave", "--backlash", "-1"], "backlash"),
    (["published", "relative-motion", "master-slave", "--carried", "0.5"], "B: expected"),
    (["published", "relative-motion", "holding", "--period", "0"], "period"),
    (["dynamics", "motors", "ur5", "--motor", "1,48"], "expected 4 to 7 numbers"),
    (["dynamics", "motors", "ur5", "--motor", "1,48,0.05,x"], "expected 4 to 7 numbers"),
    (["dynamics", "motors", "ur5", "--motor", "elbow=1,48,0.05,0.4"], "elbow_joint"),
    (["dynamics", "motors", "ur5", "--motor", "1,48,1,1", "--motor", "2,48,1,1"], "two motors of all other joints"),
    (["dynamics", "motors", "ur5", "--motor", "elbow_joint=1,48,0.05,0.4"], "shoulder_pan_joint"),
    (["dynamics", "motors", "ur5", "--motor", "1,48,0.05,-0.4"], "resistance"),
    (["coordinates", "advise", "spherical_4r", "--at", "0.3"], "at"),
    (["coordinates", "advise", "spherical_4r", "--at", "a,b,c,d"], "at"),
    (["coordinates", "advise", "spherical_4r", "--mode", "M6"], "M6"),
    (["coordinates", "advise", "spherical_4r", "--mode", "m1"], "did you mean 'M1'"),
    (["coordinates", "advise", "srms"], "srms"),
    (["coordinates", "modes", "srms"], "srms"),
    (["coordinates", "survey", "spherical_4r", "--count", "-3"], "count"),
    (["coordinates", "analyse", "spherical_4r", "--set", "gamma"], "gamma"),
    (["coordinates", "analyse", "spherical_4r", "--algorithm", "rsda"], "rsda"),
    (["coordinates", "analyse", "panda"], "give either --set of a published robot, or --lock"),
    (["coordinates", "analyse", "ssrms", "--plane", "F3"], "SHOULDER,WRIST"),
    (["coordinates", "drive", "spherical_4r"], "rates"),
    (["ik", "pandda", "--target", "0.4,0.2,0.5,1,0,0,0"], "did you mean 'panda'"),
    (["ik", "ur5"], "target: give at least one with --target or --targets"),
    (["ik", "ur5", "--target", "1,2"], "target: expected X,Y,Z or X,Y,Z,QX,QY,QZ,QW"),
    (["ik", "ur5", "--target", "1,2,x"], "target: expected numbers"),
    (["ik", "ur5", "--target", "1,2,nan"], "target: expected finite numbers"),
    (["ik", "ur5", "--target", "1,2,3,1,1,0,0"], "quaternion of norm 1.41421"),
    (["ik", "ur5", "--target", "0.4,0.2,0.5,1,0,0,0", "--frame", "tool1"], "did you mean 'tool0'"),
    (["ik", "ur5", "--target", "0.4,0.2,0.5,1,0,0,0", "--budget", "0"], "budget: expected"),
    (["ik", "ur5", "--target", "0.4,0.2,0.5,1,0,0,0", "--seed", "-1"], "seed: expected"),
    (["ik", "ur5", "--target", "0.4,0.2,0.5,1,0,0,0", "--tolerance", "0"], "tolerance: expected"),
    (["ik", "ur5", "--target", "0.4,0.2,0.5,1,0,0,0", "--sphere", "1,0,0,0.1,1,0,0"], "leave the velocity out"),
    (["ik", "ur5", "--target", "0.4,0.2,0.5,1,0,0,0", "--start", "1,2"], "start: expected shape (6,)"),
    (["ik", "ur5", "--target", "0.4,0.2,0.5,1,0,0,0", "--backend", "nativ"], "did you mean 'native'"),
    (["ik", "ur5", "--target", "0.4,0.2,0.5,1,0,0,0", "--out", "q.txt"], "out: how its name ends says"),
    (["ik", "ur5", "--target", "0.4,0.2,0.5,1,0,0,0", "--out", "none/q.csv"], "there is no such folder"),
    (["ik", "ur5", "--target", "0.4,0.2,0.5,1,0,0,0", "--out", "there.csv"], "use --force"),
    (["ik", "ur5", "--targets", "none.csv"], "there is no such file"),
    (["ik", "ur5", "--targets", "none.txt"], "targets: unknown name"),
    (["ik", "ur5", "--targets", "there.csv"], "has no target"),
    (["ik", "ur5", "--targets", "header.csv"], "did you mean 'x'"),
    (["ik", "ur5", "--targets", "short.csv"], "missing qy, qz, qw"),
    (["ik", "ur5", "--targets", "ragged.csv"], "ragged.csv line 3: expected 3 values"),
    (["ik", "ur5", "--targets", "words.csv"], "words.csv line 2: expected numbers"),
    (["ik", "ur5", "--targets", "text.npz"], "cannot be read"),
    (["ik", "ur5", "--targets", "other.npz"], "other.npz array: unknown name"),
    (["ik", "ur5", "--targets", "shape.npz"], "expected the shape n x 7 or n x 4 x 4"),
    (["ik", "ur5", "--targets", "nan.npz"], "nan.npz row 1: expected finite numbers"),
    (["ik", "ur5", "--targets", "turn.npz"], "not a rotation matrix"),
    (["walk", "--scene", "cylinder_gird"], "did you mean 'cylinder_grid'"),
    (["walk", "--robot", "hexapd"], "error: --robot: climber: unknown name, did you mean 'hexapod'"),
    (["coordinates", "drive", "ur5", "--rates", "none.csv"], "error: --rates: path: there is no such file"),
    (["walk", "--scene", "there/is/none.csv"], "there/is/none.csv"),
    (["walk", "--objective", "fast"], "objective"),
    (["walk", "--plant", "mujco"], "did you mean 'mujoco'"),
    (["walk", "--speed", "-0.1"], "speed"),
    (["walk", "--speed", "nan"], "speed"),
    (["walk", "--turn-rate", "0"], "turn-rate"),
    (["walk", "--to", "13"], "T,A"),
    (["walk", "--to", "13,40"], "place 2.A"),
    (["walk", "--scene", "truss_grid", "--to", "L9,1"], "L9,1"),
    (["walk", "--remove-rows", "30"], "no foothold has 30"),
    (["walk", "--remove", "1.5"], "share"),
    (["walk", "--gravity", "0,1"], "gravity: expected 3 numbers"),
    (["walk", "--set", "hand_radius"], "NAME=NUMBER"),
    (["walk", "--set", "hand_radus=0.1"], "did you mean 'hand_radius'"),
    (["walk", "--robot", "hexapod", "--arms", "4"], "of the robot 'walker'"),
    (["walk", "--vanish", "99,9 at 1"], "99,9"),
    (["walk", "--vanish", "13,9 at"], "NAME at SECONDS"),
    (["walk", "--fail", "arm9 at 1"], "arm9"),
    (["walk", "--fault", "slip arm1 0.01 at 1"], "no masses"),
    (["walk", "published", "--to", "13,99"], "place 2.A"),
    (["walk", "drive"], "give a file of rates"),
    (["walk", "drive", "none.csv"], "none.csv"),
    (["walk", "drive", "keyboard"], "no terminal"),
    (["walk", "drive", "keyboard", "--plant", "mujoco"], "kinematic"),
    (["walk", "drive", "--rate", "1,2 for 3"], "six finite rates"),
    (["walk", "limb"], "say what the limb is to do"),
    (["walk", "limb", "--do", "jump"], "hold FOOTHOLD"),
    (["walk", "limb", "--do", "rate 1,2 for 3"], "six finite rates"),
    (["walk", "limb", "--do", "poses none.csv"], "none.csv"),
    (["walk", "limb", "--do", "hold 13,99"], "13,99"),
    (["walk", "limb", "--do", "hold 13,9", "--limb", "arm7"], "arm7"),
    (["walk", "resume", "nowhere"], "nowhere"),
    (["export", "pandx"], "panda"),
    (["export", "panda", "--iteration-cap", "-2", "--backend", "native"], "iteration_cap"),
    (["export", "panda", "--states", "0"], "states"),
    (["export", "panda", "--solver-archive", "/none.tar.gz", "--states", "5", "--backend", "vm"], "cannot be read"),
    (["view", "play", "pnda"], "panda"),
    (["view", "first_"], "neither a recording nor replay.html"),
    (["view", "panda", "--export", "page.html"], "only runs are exported"),
    (["view", "play", "--zeromq", "tcp://0.0.0.0:5555", "--no-browser", "--backend", "vm"], "this machine"),
    (["replay", "text.npz"], "this file is no recording of ticks"),
    (["coordinates", "analyse", "ssrms", "--tree"], "one of spdm, spdm_on_ssrms"),
    (["coordinates", "analyse", "spdm_on_ssrms", "--set", "elbow, beta"], "did you mean 'elbow, "),
    *((["coordinates", "analyse", "spdm_on_ssrms", *option], "not for a tree") for option in TREE),
    *((["coordinates", "analyse", "ssrms", "--screen", "2", *own], "screen: ") for own in SCREENED),
    (["published", "relative-motion", "--table", "4.2"], "valid: 4.3"),
    (["docs", "--folder", "none"], "clone of the repository"),
]


@pytest.mark.parametrize(("arguments", "message"), REFUSED, ids=lambda x: "_".join(x) if isinstance(x, list) else "")
def test_bad_input_is_one_line_and_exit_code_2(
    arguments: list[str], message: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "first_" / "runs").mkdir(parents=True)
    for name, text in FILES.items():
        Path(name).write_text(text)
    for name, arrays in ARRAYS.items():
        np.savez(name, **arrays)
    given = USUAL.get(arguments[0], {}) if arguments[1:2] not in (["check"], ["compare"]) else {}
    options = [word for pair in given.items() if pair[0] not in arguments for word in pair if word]
    code, out, err = run(*arguments, *options)
    assert (code, out) == (2, "")
    assert message in err
    assert err.startswith("error: ")
    assert err.count("\n") == 1
    left = {path.relative_to(tmp_path).as_posix() for path in tmp_path.rglob("*")}
    assert left == {*FILES, *ARRAYS, "first_", "first_/runs"}
    assert Path("there.csv").read_text() == ""


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("analyse", "ssrms", "--lock", "joint"), "did you mean 'joint1'"),
        (("drive", "spherical_4r", "--keys", "--mode", "M4"), "terminal"),
        (("advise", "spherical_4r", "--current", "alpha"), "did you mean"),
    ],
)
def test_bad_input_is_named_after_what_was_shown(arguments: tuple[str, ...], message: str) -> None:
    code, out, err = run("coordinates", *arguments)
    assert (code, bool(out)) == (2, True)
    assert message in err
