"""What a user waits for: a process until its first command, a changed stack, memory; beside mink and pink."""

from __future__ import annotations

import json
import os
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Mapping
from pathlib import Path

from bench import prepare
from bench.descriptions import mujoco_urdf
from bench.harness import PEERS_PYTHON
from bench.pool import user_environment
from bench.problems import load
from bench.sheet import Sheet

#: Processes of each kind, in turns
PROCESSES = 10
#: Robots, and the frame whose pose is asked for
ROBOTS = {"panda": ("Panda", "panda_hand"), "ur5": ("UR5", "tool0"), "talos": ("TALOS", "wrist_left_ft_link")}

#: What every process ends with: ``answer(changed)`` declares pose, posture and limits, and steps once
_END = """
import json, os, resource, time
def spent():
    used = resource.getrusage(resource.RUSAGE_SELF)
    return time.time(), used.ru_utime + used.ru_stime
answer(False)
first = spent()
memory = int(open("/proc/self/statm").read().split()[1]) * os.sysconf("SC_PAGE_SIZE")
answer(True)
print(json.dumps([*first, *spent(), memory]))
"""
_WBC = """
import json, sys, wbc
q0 = json.loads(sys.argv[5])
robot = wbc.robots.load(sys.argv[1], base=sys.argv[3])
def answer(changed):
    stack = wbc.Stack(robot, dt=0.005)
    stack.add(wbc.tasks.EndEffector(sys.argv[2]), name="hand")
    stack.add(wbc.tasks.Posture(), weight=1e-2)
    stack.add(wbc.tasks.JointLimits())
    if changed:
        stack.add(wbc.tasks.CenterOfMass(), weight=0.1)
    assert stack.compile().step(q0).certificate.error_bound < 1e-3
"""
_MINK = """
import json, sys, mink, mujoco, numpy
text = open(sys.argv[4]).read()
spec = mujoco.MjSpec.from_string(text)
if sys.argv[3] == "floating":
    spec.worldbody.first_body().add_freejoint()
model = spec.compile()
q0, joints = numpy.array(model.qpos0), json.loads(sys.argv[6])
given = json.loads(sys.argv[5])
if sys.argv[3] == "floating":
    q0[:7] = numpy.array(given)[[0, 1, 2, 6, 3, 4, 5]]
q0[[int(model.joint(name).qposadr[0]) for name in joints]] = given[-len(joints):]
speeds = {model.joint(k).name: 2.0 for k in range(model.njnt) if model.jnt_type[k] == mujoco.mjtJoint.mjJNT_HINGE}
def answer(changed):
    configuration = mink.Configuration(model, q=q0)
    tasks = [mink.FrameTask(sys.argv[2], "body", position_cost=1.0, orientation_cost=1.0), mink.PostureTask(model, 0.1)]
    tasks += [mink.ComTask(0.3)] if changed else []
    for task in tasks:
        task.set_target_from_configuration(configuration)
    limits = [mink.ConfigurationLimit(model), mink.VelocityLimit(model, speeds)]
    mink.solve_ik(configuration, tasks, 0.005, solver="daqp", damping=1e-8, limits=limits)
"""
_PINK = """
import json, sys, pink, pinocchio, numpy
root = (pinocchio.JointModelFreeFlyer(),) if sys.argv[3] == "floating" else ()
model = pinocchio.buildModelFromUrdf(sys.argv[1], *root)
def answer(changed):
    configuration = pink.Configuration(model, model.createData(), numpy.array(json.loads(sys.argv[5])))
    tasks = [pink.FrameTask(sys.argv[2], 1.0, 1.0), pink.PostureTask(0.1)]
    tasks += [pink.tasks.ComTask(0.3)] if changed else []
    for task in tasks:
        task.set_target_from_configuration(configuration)
    limits = [pink.limits.ConfigurationLimit(model), pink.limits.VelocityLimit(model)]
    pink.solve_ik(configuration, tasks, 0.005, solver="daqp", damping=1e-8, limits=limits)
"""
#: Row -> interpreter is that of the peers, script, and whether its cache is empty
_KINDS = {
    "wbc, nothing in its cache": (False, _WBC, True),
    "wbc, native code in its cache": (False, _WBC, False),
    "mink": (True, _MINK, False),
    "pink": (True, _PINK, False),
}


def parts() -> dict[str, Sheet | str]:
    """Medians of some processes, in turns."""
    with tempfile.TemporaryDirectory(prefix="wbc-first-") as place:
        rows = [
            (f"{shown}: {kind}", *_cells(medians))
            for name, (shown, _) in ROBOTS.items()
            for kind, medians in _robot(name, Path(place)).items()
        ]
    what = ("first command: wall [s]", "processor [s]", "changed stack: wall [s]", "processor [s]", "memory [MB]")
    return {"robots": Sheet("", (f"medians of {PROCESSES} processes", *what), rows)}


def _cells(medians: list[float]) -> list[str]:
    return [*(f"{seconds:.3f}" for seconds in medians[:4]), f"{medians[4] / 1e6:.0f}"]


def _robot(name: str, place: Path) -> dict[str, list[float]]:
    """Kind -> medians of what a row says."""
    folder = getattr(prepare, name)(place / name)
    problem = load(folder).problem
    (folder / "mujoco.urdf").write_text(mujoco_urdf((folder / "robot.urdf").read_text()))
    base = "floating" if problem.floating else "fixed"
    arguments = [str(folder / "robot.urdf"), ROBOTS[name][1], base, str(folder / "mujoco.urdf")]
    arguments += [json.dumps(problem.q0), json.dumps(problem.joints)]
    warm = {"WBC_CACHE": str(place / "warm")}
    _fill(arguments, warm)
    kinds = {kind: how for kind, how in _KINDS.items() if PEERS_PYTHON.exists() or not how[0]}
    runs: dict[str, list[list[float]]] = {kind: [] for kind in kinds}
    for _ in range(PROCESSES):
        for kind, (peer, script, cold) in kinds.items():
            with tempfile.TemporaryDirectory(dir=place) as empty:
                cache = {"WBC_CACHE": empty} if cold else warm
                runs[kind].append(_run(str(PEERS_PYTHON) if peer else sys.executable, script, arguments, cache))
    return {kind: [statistics.median(column) for column in zip(*runs[kind], strict=True)] for kind in kinds}


def _run(python: str, script: str, arguments: list[str], cache: Mapping[str, str]) -> list[float]:
    """Seconds of wall and processor until the first command, the same of a changed stack, and bytes."""
    began = time.time()
    told = subprocess.run(
        [python, "-c", script + _END, *arguments],
        env={**user_environment(), **cache}, capture_output=True, text=True, check=True, cwd=os.sep,
    ).stdout  # fmt: skip
    at, used, later, more, memory = json.loads(told.splitlines()[-1])
    return [at - began, used, later - at, more - used, memory]


def _fill(arguments: list[str], cache: Mapping[str, str]) -> None:
    """Native code of both stacks into the cache."""
    script = _WBC.replace(".compile()", ".compile(wait=True)") + _END
    _run(sys.executable, script, arguments, cache)
