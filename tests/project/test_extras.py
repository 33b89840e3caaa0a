"""What is installed without extras ticks, solves and follows laws; every other part says which extra it needs."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from tests.project.layout import pyproject
from wbc.extras import EXTRAS

#: Modules whose distribution is called otherwise
DISTRIBUTIONS = {
    "mcap_protobuf": "mcap-protobuf-support",
    "flint": "python-flint",
    "pxr": "usd-core",
    "py_trees": "py-trees",
    "yaml": "pyyaml",
    "zmq": "pyzmq",
}
#: What needs each extra; laws of motion need two packages, each for its own kind
LEAST_TIME = "wbc.trajectory.time_optimal([[0.0], [1.0]], [1.0], [4.0])"
JERK_LIMITED = "wbc.trajectory.online(1, 0.01, velocity=1.0, acceleration=1.0, jerk=1.0)"
USES = {
    "analysis": "from wbc.analysis import ExactModel",
    "clips": "from wbc.retarget.sources import c3d; c3d.read_c3d(None)",
    "cluster": "from wbc.study import carrying_out; carrying_out.connected(2, None).__enter__()",
    "formats": "from wbc.formats import read_motion; read_motion('arm.urdf')",
    "foxglove": "import wbc.formats; wbc.formats.convert('no run', 'foxglove')",
    "gymnasium": "from wbc.learning import stack_actions; stack_actions(None, None, None, None, None)",
    "laws": LEAST_TIME,
    "mujoco": "wbc.robots.load('<mujoco/>')",
    "osqp": "stack.compile(solver='osqp', backend='vm')",
    "plots": "from wbc import style; style.pyplot().__enter__()",
    "programs": "from wbc.program import Program",
    "protobuf": "from wbc.formats import motion_file; motion_file._decoder(None, 'protobuf')",
    "recordings": "from wbc.log import log; log._read_parquet(None)",
    "rerun": "import wbc.formats; wbc.formats.convert('no run', 'rrd')",
    "ros2": "from wbc.formats import Ros2Plant; Ros2Plant(robot)",
    "studies": "from wbc.study import Study",
    "torch": "from wbc.learning import command_layer; command_layer(None)",
    "usd": "open('x.usda', 'w').close(); wbc.robots.load('x.usda')",
    "viewer": "wbc.viewer.show(controller)",
    "xacro": "open('x.xacro', 'w').close(); wbc.robots.load('x.xacro')",
    "zeromq": "from wbc.viewer.zeromq import ZeroMqEnd; ZeroMqEnd('tcp://127.0.0.1:0', '', 1.0)",
}
URDF = """<robot name="arm">
<link name="base"/>
<link name="tool"/>
<joint name="turn" type="revolute"><parent link="base"/><child link="tool"/><axis xyz="0 0 1"/>
<limit lower="-2" upper="2" velocity="1" effort="9"/></joint>
</robot>"""
#: What no extra is needed for; toppra needs matplotlib, so plots come last
PLAIN = """
robot = wbc.robots.load("arm.urdf")
stack = wbc.Stack(robot, dt=0.01).add(wbc.tasks.Posture(), name="posture").add(wbc.tasks.JointLimits())
controller = stack.compile(backend="vm")
assert controller.step(robot.neutral).status == "solved"
assert stack.solve(robot.neutral, goals=["posture"], backend="vm").solved
assert wbc.trajectory.time_optimal([[0.0], [1.0], [0.5]], [1.0], [4.0]).duration > 1.0
sys.modules["matplotlib"] = None
"""
USE = """
try:
    {use}
except wbc.WbcError as error:
    print(type(error).__name__, error)
"""


def test_every_module_comes_from_its_extra_alone() -> None:
    project = pyproject()["project"]
    for extra, modules in EXTRAS.items():
        for module in modules:
            name = DISTRIBUTIONS.get(module, module)
            assert any(line.startswith(name) for line in project["optional-dependencies"][extra]), (extra, module)
            # Where laws have their packages as wheels these come without an extra
            plain = [line for line in project["dependencies"] if line.startswith(name)]
            assert all("platform_machine" in line for line in plain)
            assert bool(plain) is (extra == "laws")


#: Those that leave nothing of what :data:`PLAIN` does
LATER = ("cluster", "laws")


@pytest.mark.parametrize("last", [False, True], ids=["all", "later"])
def test_a_part_without_its_package_says_which_extra(last: bool, tmp_path: Path) -> None:
    """Studies that need a cluster are studies, which need packages of their own."""
    (tmp_path / "arm.urdf").write_text(URDF)
    extras = [extra for extra in EXTRAS if (extra in LATER) is last]
    blocked = {module for extra in extras for module in EXTRAS[extra]} - {"matplotlib"}
    code = f"import sys\nsys.modules.update(dict.fromkeys({blocked}))\nimport wbc\n" + ("" if last else PLAIN)
    code += "".join(USE.format(use=USES[extra]) for extra in extras)
    done = subprocess.run([sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    lines = done.stdout.splitlines()
    for extra, line in zip(extras, lines, strict=True):
        assert line.startswith("MissingPackageError")
        assert f"pip install 'wbc[{extra}]'" in line


def test_jerk_limited_laws_say_which_package_they_need() -> None:
    code = f"import sys\nsys.modules['ruckig'] = None\nimport wbc\n{USE.format(use=JERK_LIMITED)}"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert "ruckig" in done.stdout
    assert "pip install 'wbc[laws]'" in done.stdout
