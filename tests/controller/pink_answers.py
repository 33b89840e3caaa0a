"""Velocities that pink itself answers, for ``tests/controller/test_pink.py``.

Run with the Python of the peers, from the root of the repository, after an update of pink:

    .venv-peers/bin/python -m tests.controller.pink_answers .venv
"""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pink
import pinocchio as pin

FINGERS = ["panda_finger_joint1", "panda_finger_joint2"]
#: Robot -> description, frames, whether its base floats, joints that are locked
ROBOTS: dict[str, tuple[str, list[str], bool, list[str]]] = {
    "panda": (
        "panda_description/urdf/panda.urdf",
        ["panda_hand_tcp"],
        False,
        ["panda_finger_joint1", "panda_finger_joint2"],
    ),
    "ur5": ("ur_description/urdf/ur5_robot.urdf", ["tool0"], False, []),
    "kinova": ("kinova_description/robots/kinova.urdf", ["j2s6s200_end_effector"], False, []),
    "talos": (
        "talos_data/robots/talos_reduced.urdf",
        ["left_sole_link", "right_sole_link", "wrist_left_ft_link", "wrist_right_ft_link"],
        True,
        [],
    ),
}
OUT = Path(__file__).with_name("data") / "pink.json"
#: Cost of a metre and of a radian; squares of the posture's cost; damping; time between commands [s]; share of an error
#: that a step removes
METRE, RADIAN, POSTURE, DAMPING, DT, GAIN = 2.0, 0.7, 1e-3, 1e-8, 0.01, 0.2
CASES = 6


def answers(model: pin.Model, frames: list[str], floating: bool, rng: np.random.Generator) -> list[dict[str, Any]]:
    """Random configurations and targets, with pink's velocity; limits bind in every other case."""
    lower, upper = model.lowerPositionLimit.copy(), model.upperPositionLimit.copy()
    wide = ~((lower > -100.0) & (upper < 100.0))
    lower[wide], upper[wide] = -2.0, 2.0
    out = []
    for k in range(CASES):
        q = lower + (upper - lower) * rng.uniform(0.2, 0.8, model.nq)
        if floating:
            q[:7] = pin.integrate(model, pin.neutral(model), rng.normal(size=model.nv))[:7]
        q = pin.normalize(model, q)
        size = 0.6 if k % 2 else 0.02
        moved = pin.integrate(model, q, size * rng.normal(size=model.nv))
        configuration = pink.Configuration(model, model.createData(), moved)
        targets = [configuration.get_transform_frame_to_world(name).copy() for name in frames]
        tasks: list[Any] = []
        for name, target in zip(frames, targets, strict=True):
            task = pink.FrameTask(name, position_cost=METRE, orientation_cost=RADIAN, gain=GAIN)
            task.set_target(target)
            tasks.append(task)
        posture = pink.PostureTask(cost=float(np.sqrt(POSTURE)), gain=GAIN)
        posture.set_target(pin.neutral(model))
        configuration = pink.Configuration(model, model.createData(), q)
        limits = [pink.limits.ConfigurationLimit(model, config_limit_gain=1.0), pink.limits.VelocityLimit(model)]
        v = pink.solve_ik(
            configuration, [*tasks, posture], DT, solver="quadprog", damping=DAMPING, limits=limits, barriers=[]
        )
        out.append({"q": q.tolist(), "targets": [t.homogeneous.tolist() for t in targets], "v": v.tolist()})
    return out


def main() -> None:
    """Write the file."""
    packages = Path(sys.argv[1]).resolve().glob("lib/python*/site-packages")
    folder = next(packages) / "cmeel.prefix" / "share" / "example-robot-data" / "robots"
    rng, found = np.random.default_rng(0), {}
    for name, (urdf, frames, floating, locked) in ROBOTS.items():
        model = pin.buildModelFromUrdf(str(folder / urdf), *([pin.JointModelFreeFlyer()] if floating else []))
        model = pin.buildReducedModel(model, [model.getJointId(joint) for joint in locked], pin.neutral(model))
        cases = answers(model, frames, floating, rng)
        found[name] = {"urdf": urdf, "frames": frames, "floating": floating, "locked": locked, "cases": cases}
    constants = {"metre": METRE, "radian": RADIAN, "posture": POSTURE, "damping": DAMPING, "dt": DT, "gain": GAIN}
    OUT.parent.mkdir(exist_ok=True)
    OUT.write_text(json.dumps({"pink": pink.__version__, **constants, "robots": found}) + "\n")


if __name__ == "__main__":
    main()
