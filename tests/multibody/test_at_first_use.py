"""What is imported: Pinocchio when something of it is asked for, and no module that only Unix has."""

from __future__ import annotations

import copy
import pickle
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest

import wbc.robots
from tests.multibody.own import drawn_model, own_model
from tests.repeats import repeats
from wbc.errors import RobotFileError
from wbc.multibody import PINOCCHIO, own, to_pin
from wbc.shapes import PlacedShape, Sphere

TICKS = """
import sys, wbc
robot = wbc.robots.load(sys.argv[1]).with_limits(velocity=1.0)
stack = wbc.Stack(robot, dt=0.005)
stack.add(wbc.tasks.EndEffector(robot.frame_names[-1]), name="hand")
stack.add(wbc.tasks.CenterOfMass(), weight=0.1)
stack.add(wbc.tasks.Posture(), weight=1e-3)
stack.add(wbc.tasks.JointLimits())
controller = stack.compile()
controller.step(robot.neutral)
controller["hand"].target = [[1.0, 0, 0, 0.3], [0, 1, 0, 0], [0, 0, 1, 0.5], [0, 0, 0, 1]]
controller["hand"].target = [0.3, 0.1, 0.5, 0, 0, 0, 1]
assert controller.step(robot.neutral).certificate.error_bound < 1e-3
loaded = {"pinocchio", "coal", "eigenpy", "numpy.random"} & set(sys.modules)
assert not loaded, loaded
robot.model
print("pinocchio" in sys.modules)
"""


@pytest.mark.parametrize("name", ["ur5", "talos"])
def test_ticks_without_an_import(name: str) -> None:
    ran = subprocess.run([sys.executable, "-c", TICKS, name], capture_output=True, text=True, check=False)
    assert (ran.returncode, ran.stdout) == (0, f"{PINOCCHIO}\n"), ran.stderr


def test_a_tree_and_its_model_say_the_same() -> None:
    for seed in range(repeats(10)):
        rng = np.random.default_rng(seed)
        tree = own_model(drawn_model(rng))
        tree.referenceConfigurations["home"] = own.neutral(tree)
        tree.frames[0].placement = own.SE3.Random()
        model = to_pin(tree)
        assert isinstance(model, pin.Model)
        again = own_model(model)
        again.frames[0].placement = own.SE3(model.frames[0].placement)
        again.referenceConfigurations["home"] = np.array(model.referenceConfigurations["home"])
        assert again.saveToString() == tree.saveToString()
        q = pin.randomConfiguration(model, -np.ones(model.nq), np.ones(model.nq))
        v = rng.normal(size=model.nv)
        theirs = pin.rnea(model, model.createData(), q, v, v)
        largest = max(1.0, np.abs(theirs).max())
        np.testing.assert_allclose(own.rnea(tree, tree.createData(), q, v, v), theirs, rtol=0, atol=1e-11 * largest)


def test_a_model_that_was_changed_in_place_is_refused() -> None:
    robot = wbc.robots.load("ur5", shapes="none")
    wbc.Stack(robot, dt=0.01)
    assert isinstance(robot.model, pin.pinocchio_pywrap_default.Model)
    robot.model.armature = np.ones(robot.nv)
    with pytest.raises(RobotFileError, match=r"changed in place.*replace\(robot, model=changed\)"):
        wbc.Stack(robot, dt=0.01)
    with pytest.raises(RobotFileError, match="changed in place"):
        robot.with_limits(velocity=1.0)
    given = replace(robot, model=robot.model)
    assert given.tree is given.model
    wbc.Stack(given, dt=0.01)


def test_copies_and_pickles_have_the_tree_and_convert_anew() -> None:
    robot = wbc.robots.load("ur5")
    model = robot.model
    for made in (pickle.loads(pickle.dumps(robot)), copy.deepcopy(robot), copy.copy(robot)):
        assert isinstance(made.tree, own.Model)
        assert made.fingerprint == robot.fingerprint
        assert made.model == model
    assert b"pinocchio" not in pickle.dumps(robot)


def test_a_placement_is_handed_out_as_pinocchios() -> None:
    pose = pin.SE3.Random()
    for given in (pose, pose.homogeneous, own.SE3(pose.homogeneous)):
        placed = PlacedShape(Sphere(0.1), given)
        assert isinstance(placed.placement, pin.SE3)
        np.testing.assert_array_equal(placed.placement.homogeneous, pose.homogeneous)
        assert isinstance(pickle.loads(pickle.dumps(placed)).place, own.SE3)


#: Windows has msvcrt, whose locks do nothing here; numpy and casadi are imported as on this platform
PROGRAM = """
import sys, types
import casadi, ctypes, multiprocessing, numpy, os, platformdirs, scipy, subprocess, tempfile
for name in ("fcntl", "grp", "pwd", "resource", "termios", "tty"):
    sys.modules[name] = None
for name in ("fork", "getuid", "register_at_fork", "sched_getaffinity", "sched_setscheduler", "statvfs"):
    vars(os).pop(name)
sys.modules["msvcrt"] = types.SimpleNamespace(locking=lambda *_: None, LK_LOCK=1, LK_NBLCK=2, LK_UNLCK=0)
sys.platform = "win32"
import importlib, pkgutil
import wbc
for part in ("api", "ik", "log", "record", "replaying", "robot", "simulation", "study", "terminal", "tasks"):
    package = importlib.import_module(f"wbc.{part}")
    for module in pkgutil.walk_packages(getattr(package, "__path__", []), f"wbc.{part}."):
        importlib.import_module(module.name)
robot = wbc.robots.load("panda")
stack = wbc.Stack(robot, dt=0.005)
stack.add(wbc.tasks.EndEffector("panda_hand_tcp"), name="hand")
print(robot.pose(robot.neutral, "panda_hand_tcp").translation.round(6))
"""


def test_the_core_imports_and_loads_without_unix() -> None:
    done = subprocess.run([sys.executable, "-c", PROGRAM], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr[-2000:]
    assert done.stdout.strip()
