"""``python -m bench.retarget``: clips to robots beside GMR's kernel and OmniRetarget: time, slide, depth, key points.

    python -m bench.retarget --peers-python .venv-peers/bin/python
    python -m bench.retarget --clips FOLDER/holosoma_retargeting/demo_data --omniretarget-python ENV/bin/python

The clips are made from seeds; with ``--clips`` those of files, too. GMR's kernel follows the very key points that ours
follows, from our first frame, so that its errors and ours are distances from the same places. Times are processor
time of one process without what is compiled once. Figures of a motion are measured by one function for all of them.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

import wbc
from bench.figures.store import stamp
from bench.harness import machine
from tests.retarget import clips
from wbc.interrupts import obey_interrupts
from wbc.multibody import pin
from wbc.retarget import Clip, Retargeted, Retargeter, load_clip, motion_figures
from wbc.robot.mujoco_joints import MujocoJoints
from wbc.rotations import TO_MUJOCO, quaternion
from wbc.simulation import mujoco_spec

#: Frames of a clip of files that are taken, at most: peers take a second for one
MOST_FRAMES = 600
#: Runs of ours of which the median time counts: one takes hundredths of a second
RUNS = 5
#: Frames that OmniRetarget gets
OMNI_FRAMES = 30
#: Frames a second of the wheel's clips: of its tensors, and of its arrays [Hz]
RATES = {".pt": 30.0, ".npy": 120.0}


@dataclass(frozen=True)
class Row:
    """A clip by one program.

    Attributes:
        clip, robot, program: names. frames: of the motion. rate: frames that it makes a second of processor time [1/s].
        point_error: mean distance of key points from their targets [m]; -1: it has other targets.
        slide, penetration: largest of the motion [m].
        breaches: frames beyond limits of position, velocity or acceleration. jumps: see ``motion_figures``.
    """

    clip: str
    robot: str
    program: str
    frames: int
    rate: float
    point_error: float
    slide: float
    penetration: float
    breaches: int
    jumps: int


def made_clips(rate: float = 50.0) -> Iterator[Clip]:
    """Those made from a seed."""
    for motion in clips.MOTIONS.values():
        yield motion(1, rate).clip


def clips_of(folder: Path) -> Iterator[tuple[Clip, Path]]:
    """Those of files, the first frames."""
    for file in sorted(file for file in folder.rglob("*") if file.suffix in RATES):
        clip = load_clip(file, rate=RATES[file.suffix])
        count = min(len(clip.points), MOST_FRAMES)
        yield Clip(clip.skeleton, clip.rate, clip.points[:count], None, clip.seen[:count], file.stem, clip.notes), file


def ours(retargeter: Retargeter, clip: Clip) -> tuple[Row, Retargeted]:
    """By this package, when all is compiled: the median time of some runs."""
    plan = retargeter.run(clip).plan
    engine = retargeter.engine(plan.limbs, plan.dt, head="head" in plan.turns)
    engine.controller.settled()
    motion, seconds = retargeter.run(clip), []
    for _ in range(RUNS):
        start = time.process_time()
        motion = retargeter.run(clip)
        seconds.append(time.process_time() - start)
    return _row(motion, "wbc", motion.q, float(np.median(seconds)), motion.errors.mean), motion


def gmr(python: str, motion: Retargeted) -> Row:
    """By GMR's kernel on the same key points."""
    names, frames, positions, rotations = _targets(motion)
    spec = mujoco_spec(motion.robot, drawn=False)
    spec.compile()
    for name in frames:
        frame = motion.robot.model.frames[motion.robot.model.getFrameId(name)]
        body = spec.joint(str(motion.robot.model.names[frame.parentJoint])).parent
        body.add_site(
            name=f"site {name}", pos=frame.placement.translation, quat=quaternion(frame.placement.rotation)[TO_MUJOCO]
        )
    model = spec.compile()
    joints, start = MujocoJoints(model, motion.robot), np.array(model.qpos0)
    joints.put_q(start, motion.q[0])
    with tempfile.TemporaryDirectory() as folder:
        given, answer = Path(folder) / "given.npz", Path(folder) / "answer.npz"
        np.savez(
            given, xml=np.array(spec.to_xml()), names=names, sites=[f"site {name}" for name in frames],
            positions=positions, rotations=rotations, start=start,
        )  # fmt: skip
        _call(python, "mink", given, answer)
        with np.load(answer) as data:
            q, seconds = np.array([joints.q(row) for row in data["q"]]), float(data["seconds"])
    error = float(np.linalg.norm(_places(motion, frames, q) - positions, axis=2)[:, _points(names)].mean())
    return _row(motion, "GMR's kernel", q, seconds, error)


def omniretarget(python: str, file: Path, motion: Retargeted) -> Row:
    """By OmniRetarget, the first frames; its joints have the same names, and its targets are its own."""
    with tempfile.TemporaryDirectory() as folder:
        answer = Path(folder) / "answer.npz"
        _call(python, "omniretarget", file, answer, str(OMNI_FRAMES))
        with np.load(answer) as data:
            qpos, seconds = data["q"], float(data["seconds"])
    # Root, quaternion w, x, y, z, and its 29 joints in the order of its model, which is ours
    q = np.concatenate([qpos[:, :3], qpos[:, [4, 5, 6, 3]], qpos[:, 7 : 7 + motion.robot.nq - 7]], axis=1)
    rate = RATES[file.suffix] / (4.0 if file.suffix == ".npy" else 1.0)
    return _row(motion, "OmniRetarget", q, seconds, -1.0, rate)


def _call(python: str, *arguments: str | Path) -> None:
    file = Path(__file__).with_name("retarget_peers.py")
    done = subprocess.run([python, str(file), *map(str, arguments)], capture_output=True, text=True, check=False)
    if done.returncode:
        raise RuntimeError(done.stderr[-2000:])


def _targets(motion: Retargeted) -> tuple[list[str], list[str], np.ndarray, np.ndarray]:
    """Names and frames of key points, their places, and rotations (NaN: free), at the frames of the motion."""
    plan, body, every = motion.plan, motion.body, motion.every
    free = np.full((len(plan.pelvis), 3, 3), np.nan)
    rows: list[tuple[str, str, np.ndarray, np.ndarray]] = [("pelvis", body.pelvis, plan.pelvis, plan.turns["pelvis"])]
    if body.chest:
        rows.append(("chest", body.chest, plan.pelvis, plan.turns["chest"]))
    for number, name in enumerate(plan.limbs):
        _, middle, wrist, end = np.moveaxis(plan.chains[:, number], 1, 0)
        own = body.limbs[name]
        if own.middle:
            rows.append((f"{name} middle", own.middle, middle, free))
        if own.wrist and name.endswith("arm"):
            rows.append((f"{name} wrist", own.wrist, wrist, free))
        rows.append((name, own.end, end, plan.turns.get(name, free)))
    names, frames, places, turns = zip(*rows, strict=True)
    positions = np.stack([place[::every] for place in places], axis=1)
    return list(names), list(frames), positions, np.stack([turn[::every] for turn in turns], axis=1)


def _points(names: list[str]) -> list[int]:
    """Those that have a place; the chest has a rotation alone."""
    return [number for number, name in enumerate(names) if name != "chest"]


def _places(motion: Retargeted, frames: list[str], q: np.ndarray) -> np.ndarray:
    """Where the frames are [frames of the motion, frames, 3]."""
    model, data = motion.robot.model, motion.robot.model.createData()
    numbers = [model.getFrameId(name) for name in frames]
    out = np.empty((len(q), len(frames), 3))
    for k, row in enumerate(q):
        pin.framesForwardKinematics(model, data, row)
        out[k] = [data.oMf[number].translation for number in numbers]
    return out


def _row(
    motion: Retargeted, program: str, q: np.ndarray, seconds: float, error: float, rate: float | None = None
) -> Row:
    feet = {motion.body.limbs[limb].end: np.asarray(stands) for limb, stands in motion.stance.items()}
    if len(q) != len(motion.q):
        # Other frames: which feet stand is known at ours
        at = np.clip(
            np.round(np.arange(len(q)) / (rate or motion.rate) * motion.rate).astype(int), 0, len(motion.q) - 1
        )
        feet = {foot: stands[at] for foot, stands in feet.items()}
    balls = {limb.end for limb in motion.body.limbs.values() if limb.radius > 0.0}
    figures: Mapping[str, Any] = motion_figures(motion.robot, rate or motion.rate, q, feet, balls=balls)
    breaches = sum(figures[f"{what}_breaches"] for what in ("position", "velocity", "acceleration"))
    return Row(
        motion.clip.name, motion.robot.name, program, len(q), len(q) / seconds, error, figures["slide"],
        figures["penetration"], breaches, figures["jumps"],
    )  # fmt: skip


def table(rows: list[Row]) -> str:
    """As Markdown: a line a clip, and in its cells the programs in the order that the first one says."""
    programs = list(dict.fromkeys(row.program for row in rows))
    heads = ("frames", "frames/s", "key points [mm]", "slide [mm]", "below ground [mm]", "beyond limits", "jumps")
    lines = [f"| {'/'.join(programs)} | {' | '.join(heads)} |", "|---" + "|---:" * len(heads) + "|"]
    clips_there = dict.fromkeys((row.clip, row.robot) for row in rows)
    for clip, robot in clips_there:
        own = {row.program: _cells(row) for row in rows if (row.clip, row.robot) == (clip, robot)}
        frames = next(row.frames for row in rows if (row.clip, row.robot) == (clip, robot))
        missing = ("-",) * (len(heads) - 1)
        columns = zip(*(own.get(program, missing) for program in programs), strict=True)
        name = clip if len({row.robot for row in rows}) == 1 else f"{clip} to {robot}"
        lines.append(f"| {name} | {frames} | {' | '.join(map('/'.join, columns))} |")
    return "\n".join(lines)


def _cells(row: Row) -> tuple[str, ...]:
    """A program's figures of a clip, for :func:`table`."""
    error = "-" if row.point_error < 0.0 else f"{1e3 * row.point_error:.1f}"
    lengths = (f"{1e3 * length:.2g}" for length in (row.slide, row.penetration))
    return f"{row.rate:.0f}", error, *lengths, str(row.breaches), str(row.jumps)


def page(data: Mapping[str, Any]) -> str:
    """The table of a file that :func:`main` wrote."""
    return table([Row(**row) for row in data["rows"]])


def main() -> None:
    """Measure, print, and write what was asked for; Ctrl-C keeps what was measured until then."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--robots", nargs="+", default=["g1"])
    parser.add_argument("--clips", type=Path, help="folder with clips of files, as demo_data of holosoma_retargeting")
    parser.add_argument("--peers-python", help="of an environment with mink")
    parser.add_argument("--omniretarget-python", help="of an environment with holosoma-retargeting")
    parser.add_argument("--only", nargs="+", help="names of clips")
    parser.add_argument("--json", type=Path, help="file that is written")
    options = parser.parse_args()
    obey_interrupts()
    about = {"stamp": stamp(), "machine": machine()}
    rows: list[Row] = []
    try:
        for robot in options.robots:
            retargeter = Retargeter(wbc.robots.load(robot, base="floating"))
            given: list[tuple[Clip, Path | None]] = [(clip, None) for clip in made_clips()]
            given += list(clips_of(options.clips)) if options.clips else []
            for clip, file in given:
                if options.only and clip.name not in options.only:
                    continue
                row, motion = ours(retargeter, clip)
                rows.append(row)
                if options.peers_python:
                    rows.append(gmr(options.peers_python, motion))
                if options.omniretarget_python and file is not None and robot == "g1":
                    rows.append(omniretarget(options.omniretarget_python, file, motion))
                print(table(rows[-3:]).splitlines()[-1], file=sys.stderr)
    except KeyboardInterrupt:
        print("ended early", file=sys.stderr)
    print(table(rows))
    if options.json:
        found = {**about, "rows": [asdict(row) for row in rows]}
        options.json.write_text(json.dumps(found, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
