"""Joints without end turn the other way round where the short one is blocked: against a flood of the whole torus."""

from __future__ import annotations

from itertools import product
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

import wbc
from tests.plan.scenes import CoalJudge, at
from wbc.robot import Robot
from wbc.shapes import Sphere

#: Cells of a turn
CELLS = 72
#: How far the arm reaches [m]
REACH = 0.8


ROD = (
    '<link name="{0}"><collision><origin xyz="0.2 0 0" rpy="0 1.5707963267948966 0"/><geometry>'
    '<cylinder radius="0.03" length="0.24"/></geometry></collision></link>'
)
JOINT = (
    '<joint name="{0}" type="continuous"><parent link="{1}"/><child link="{2}"/><origin xyz="{3} 0 0"/>'
    '<axis xyz="0 0 1"/></joint>'
)


def arm(tmp_path: Path) -> Robot:
    """Two rods in a plane, on joints without end."""
    file = tmp_path / "arm.urdf"
    rods = "".join(map(ROD.format, ("upper", "fore")))
    joints = JOINT.format("shoulder", "base", "upper", 0) + JOINT.format("elbow", "upper", "fore", 0.4)
    file.write_text(f'<robot name="arm"><link name="base"/>{rods}{joints}</robot>')
    return wbc.robots.load(file)


def reached(free: np.ndarray, start: tuple[int, int]) -> np.ndarray:
    """Cells that free ones lead to, round both ways."""
    out, new = np.zeros_like(free), np.zeros_like(free)
    new[start] = True
    while new.any():
        out |= new
        spread = [np.roll(new, step, axis) for step in (-1, 1) for axis in (0, 1)]
        new = np.logical_or.reduce(spread) & free & ~out
    return out


@pytest.mark.parametrize("seed", [3, 5, 16, 21])
def test_whatever_the_torus_leads_to_is_found(seed: int, tmp_path: Path) -> None:
    rng, robot = np.random.default_rng(seed), arm(tmp_path)
    stack = wbc.Stack(robot, dt=0.01)
    for k, angle in enumerate(rng.uniform(-np.pi, np.pi, 3)):
        x, y = rng.uniform(0.35, 0.7) * np.array([np.cos(angle), np.sin(angle)])
        stack.add(wbc.tasks.Obstacle(Sphere(0.05), pose=at(x, y, 0.0)), name=f"ball{k}")
    judge, angles = CoalJudge(stack), 2.0 * np.pi * np.arange(CELLS) / CELLS
    turned = [robot.integrate(pin.neutral(robot.model), np.array(pair)) for pair in product(angles, angles)]
    margins = np.reshape([judge.margin(q) for q in turned], (CELLS, CELLS))
    free = margins > 2.0 * np.pi * REACH / CELLS
    cells, planner, far = np.argwhere(free), stack.planner(), 0.0
    for start, goal in rng.permutation(cells)[:12].reshape(-1, 2, 2):
        if not reached(free, tuple(start))[tuple(goal)]:
            continue
        ends = [turned[cell[0] * CELLS + cell[1]] for cell in (start, goal)]
        path = planner.plan(*ends, seed=seed)
        assert judge.least(path) > -1e-4
        for q, end in zip(path.q[[0, -1]], ends, strict=True):
            assert np.abs(robot.difference(q, end)).max() < 1e-9
        far = max(far, float(np.abs(path.points[-1] - path.points[0]).max()))
    assert far > np.pi
