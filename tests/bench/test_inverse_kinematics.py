"""The benchmark of inverse kinematics: what it asks for can be reached, and its judge is strict."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pinocchio as pin

from bench.ik.chains import CHAINS, Judge, configuration, prepare

ROOT = Path(__file__).parents[2]


def test_every_chain_is_an_arm_and_its_poses_can_be_reached(tmp_path: Path) -> None:
    for chain in CHAINS:
        problem = prepare(chain, tmp_path, count=5, seed=3)
        model, judge = pin.buildModelFromUrdf(str(problem.urdf)), Judge(problem)
        assert len(problem.joints) == model.nv
        assert model.nv in (6, 7)
        drawn = np.random.default_rng(3).uniform(problem.lower, problem.upper, (5, model.nv))
        for angles, pose in zip(drawn, problem.poses, strict=True):
            assert judge.accepts(configuration(model, angles), pose, 1e-5)
            assert not judge.accepts(configuration(model, angles + 1e-3), pose, 1e-5)


def test_the_judge_refuses_joints_outside_their_limits(tmp_path: Path) -> None:
    problem = prepare(CHAINS[0], tmp_path, count=1, seed=3)
    model, judge = pin.buildModelFromUrdf(str(problem.urdf)), Judge(problem)
    angles = problem.start.copy()
    angles[0] = problem.upper[0] + 0.1
    q = configuration(model, angles)
    data = model.createData()
    pin.framesForwardKinematics(model, data, q)
    pose = data.oMf[model.getFrameId(problem.chain.tip)].homogeneous
    assert not judge.accepts(q, pose, 1e-5)


def test_a_small_run_writes_its_table(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "bench.ik", "--count", "30", "--chains", "Panda", "--budget", "0.5"]
    folders = ["--work", str(tmp_path / "work"), "--output", str(tmp_path)]
    done = subprocess.run([*command, *folders], cwd=ROOT, capture_output=True, text=True, check=True)
    assert "pink and mink are left out" in done.stdout
    (row,) = json.loads((tmp_path / "inverse_kinematics.json").read_text())["rows"]
    assert row["rate"] == 100.0
    assert row["published"] == 99.88
    assert "| Panda | 7 | wbc | 30 | 100.00 |" in (tmp_path / "inverse_kinematics.md").read_text()
