"""Writes what Pinocchio computes for every robot of the table: python -m tests.multibody.answers

Of a random state of each: sums over all frames of poses and Jacobians with weights cos(k), k the frame's number, and
what the mass matrix, its bias and gravity make of vectors. Stored with the state, see :func:`summary`.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

import wbc.robots
from wbc.multibody import PINOCCHIO, pin

FILE = Path(__file__).parent / "answers.npz"


def summary(algebra: Any, model: Any, q: np.ndarray, v: np.ndarray) -> dict[str, np.ndarray]:
    """By Pinocchio, or by what stands for it: numbers that no frame, Jacobian, mass or bias can change unseen."""
    data = model.createData()
    weights = np.cos(np.arange(len(model.frames)))
    algebra.computeJointJacobians(model, data, q)
    algebra.updateFramePlacements(model, data)
    poses = sum(w * data.oMf[k].homogeneous[:3] for k, w in enumerate(weights))
    axes = algebra.ReferenceFrame.LOCAL_WORLD_ALIGNED
    jacobian = sum(w * algebra.getFrameJacobian(model, data, k, axes) for k, w in enumerate(weights))
    mass = np.array(algebra.crba(model, data, q))
    return {
        "poses": np.ravel(poses),
        "twist": jacobian @ v,
        "moments": jacobian.T @ np.cos(np.arange(6)),
        "masses": mass @ np.cos(np.arange(model.nv)),
        "bias": np.array(algebra.nonLinearEffects(model, data, q, v)),
        "gravity": np.array(algebra.computeGeneralizedGravity(model, data, q)),
    }


def states(robot: wbc.robots.Robot, seed: int) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    return robot.random(rng), rng.normal(size=robot.nv)


def write() -> None:
    assert PINOCCHIO, "Pinocchio writes the answers"
    stored = {}
    for seed, name in enumerate(wbc.robots.names()):
        robot = wbc.robots.load(name, shapes="none")
        q, v = states(robot, seed)
        stored[name] = np.concatenate([q, v, *summary(pin, robot.model, q, v).values()])
    np.savez_compressed(FILE, **stored)
    print(f"{len(stored)} robots, {FILE.stat().st_size / 1e3:.0f} kB")


if __name__ == "__main__":
    write()
