"""What the package imports and loads where Python has no modules and calls of Unix, as on Windows."""

from __future__ import annotations

import subprocess
import sys

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
