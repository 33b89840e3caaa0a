"""The benchmark of inverse kinematics: what it asks for can be reached, and its judge is strict."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

from bench.ik.__main__ import main
from bench.ik.chains import CHAINS, Judge, configuration, prepare
from bench.ik.run import summary


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


def test_a_small_run_writes_its_table(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    main(["--count", "30", "--chains", "Panda", "--budget", "0.5", "--output", str(tmp_path)])
    assert "pink and mink are left out" in capsys.readouterr().out
    results = json.loads((tmp_path / "ik.json").read_text())
    (row,), (batch,) = results["rows"], results["batches"]
    assert (row["rate"], row["published"], row["poses"], results["interrupted"]) == (100.0, 99.88, 30, None)
    assert (batch["rate"], batch["poses"]) == (100.0, 30)
    head, _, cells = summary(results).splitlines()[:3]
    assert head.startswith("| chain | joints | solved [%] | TRAC-IK published [%] |")
    assert cells.startswith("| Panda | 7 | 100.00 | 99.88 |")
