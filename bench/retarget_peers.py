"""What a peer makes of the same clips; runs in the peer's environment and imports nothing of this repository.

    python bench/retarget_peers.py mink TARGETS.npz ANSWER.npz
    python bench/retarget_peers.py omniretarget CLIP ANSWER.npz FRAMES

``mink`` is the kernel of GMR, General Motion Retargeting (Ze et al.), with a table written by hand: two passes over
tasks with other weights, each repeated until the error falls by less than 1e-3, at most ten times, by DAQP with a
damping of 0.5, within limits of position and of 3 pi rad/s. ``omniretarget`` is the interaction mesh of the wheel
holosoma-retargeting on its own clips.
"""

from __future__ import annotations

import os
import shutil
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np

#: End of a key point's name -> weights of its position and its rotation, in the first and in the second pass
TABLE = {
    "pelvis": (10.0, 10.0, 100.0, 5.0),
    "chest": (0.0, 10.0, 0.0, 10.0),
    "leg middle": (0.0, 0.0, 10.0, 0.0),
    "leg": (100.0, 10.0, 100.0, 10.0),
    "arm middle": (0.0, 0.0, 10.0, 0.0),
    "arm wrist": (0.0, 0.0, 10.0, 0.0),
    "arm": (10.0, 0.0, 10.0, 0.0),
}
#: Errors that fall by less end a pass
LEAST_GAIN = 1e-3
#: Further steps of a pass, at most
MOST_STEPS = 10
#: Damping of each step
DAMPING = 0.5
#: Limit of velocity [rad/s]
FASTEST = 3.0 * np.pi


def weights_of(name: str) -> tuple[float, float, float, float]:
    """Those of the longest ending that a key point's name has."""
    plain = name.replace("_", " ")
    return TABLE[max((end for end in TABLE if plain.endswith(end)), key=len)]


def run_mink(targets: Path, answer: Path) -> None:
    """Follow targets of key points, sites of a model, frame by frame."""
    import mink
    import mujoco

    with np.load(targets) as data:
        given = {name: data[name] for name in data.files}
    model = mujoco.MjModel.from_xml_string(str(given["xml"]))
    names, positions, rotations = [str(n) for n in given["names"]], given["positions"], given["rotations"]
    configuration = mink.Configuration(model, q=given["start"])
    hinges = [model.joint(k).name for k in range(model.njnt) if model.jnt_type[k] == mujoco.mjtJoint.mjJNT_HINGE]
    limits = [mink.ConfigurationLimit(model), mink.VelocityLimit(model, dict.fromkeys(hinges, FASTEST))]
    passes: list[list[tuple[int, Any]]] = [[], []]
    for number, name in enumerate(names):
        weights = weights_of(name)
        for which, tasks in enumerate(passes):
            position, rotation = weights[2 * which : 2 * which + 2]
            rotation *= float(np.isfinite(rotations[0, number]).all())
            if position or rotation:
                task = mink.FrameTask(str(given["sites"][number]), "site", position, rotation, lm_damping=1.0)
                tasks.append((number, task))
    q = np.empty((len(positions), model.nq))
    dt = model.opt.timestep
    start = time.process_time()
    for frame in range(len(positions)):
        for tasks in passes:
            for number, task in tasks:
                turn = rotations[frame, number]
                pose = np.eye(4)
                pose[:3, :3], pose[:3, 3] = turn if np.isfinite(turn).all() else np.eye(3), positions[frame, number]
                task.set_target(mink.SE3.from_matrix(pose))
            only = [task for _, task in tasks]
            before = _error(configuration, only)
            for _ in range(MOST_STEPS + 1):
                step = mink.solve_ik(configuration, only, dt, "daqp", DAMPING, limits=limits)
                configuration.integrate_inplace(step, dt)
                after = _error(configuration, only)
                if before - after <= LEAST_GAIN:
                    break
                before = after
        q[frame] = configuration.q
    np.savez(answer, q=q, seconds=time.process_time() - start)


def _error(configuration: Any, tasks: list[Any]) -> float:
    return float(np.linalg.norm(np.concatenate([task.compute_error(configuration) for task in tasks])))


def run_omniretarget(clip: Path, answer: Path, frames: int) -> None:
    """Retarget the first frames of a clip of the wheel to a G1, on level ground."""
    import holosoma_retargeting

    home = Path(holosoma_retargeting.__file__).parent
    folder = Path(tempfile.mkdtemp())
    if clip.suffix == ".pt":
        import torch

        torch.save(torch.load(clip)[:frames].clone(), folder / clip.name)
        kind = "smplh"
    else:
        # It takes every fourth frame
        np.save(folder / clip.name, np.load(clip)[: 4 * frames])
        kind = "mocap"
    os.chdir(home)
    # Its scripts are no package
    sys.path[:0] = [str(home), str(home / "src"), str(home / "examples")]
    import robot_retarget
    import tyro

    arguments = [
        "--data_path", str(folder), "--task-type", "robot_only", "--task-name", clip.stem, "--data_format", kind,
        "--save_dir", str(folder / "out"),
    ]  # fmt: skip
    config = tyro.cli(robot_retarget.RetargetingConfig, args=arguments)
    start = time.process_time()
    robot_retarget.main(config)
    seconds = time.process_time() - start
    with np.load(next((folder / "out").rglob("*.npz"))) as data:
        np.savez(answer, q=data["qpos"], seconds=seconds)
    shutil.rmtree(folder)


if __name__ == "__main__":
    if sys.argv[1] == "mink":
        run_mink(Path(sys.argv[2]), Path(sys.argv[3]))
    else:
        run_omniretarget(Path(sys.argv[2]), Path(sys.argv[3]), int(sys.argv[4]))
