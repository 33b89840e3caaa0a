"""``wbc dynamics motors`` as a user types it."""

from __future__ import annotations

import re

import pytest

import wbc
from tests.cli.test_commands import run as wbc_command
from wbc.motion_control import Actuator, ActuatorSizing
from wbc.motion_control.comparison import swing

MOTOR = Actuator(1.0, 48.0, 0.05, 0.4, 100.0, 3e-5)
SMALL = Actuator(0.3, 24.0, 0.05, 0.4, 100.0)


def run(*arguments: str) -> tuple[int, str]:
    code, out, err = wbc_command("dynamics", "motors", *arguments)
    return code, out + err


def test_bounds_are_those_of_the_library_and_say_what_binds() -> None:
    robot = wbc.robots.load("ur5")
    given = ["--motor", "1,48,0.05,0.4,100,3e-5", "--motor", "wrist_1_joint=0.3,24,0.05,0.4,100"]
    code, out = run("ur5", *given, "--payload", "0.5", "--speed", "0.8")
    sizing = ActuatorSizing(
        robot, swing(robot, 2.0), 2.0, dict.fromkeys(robot.dof_names, MOTOR) | {"wrist_1_joint": SMALL}
    )
    assert code == 0
    for bound, line in zip((sizing.largest_load(0.8), sizing.largest_speed(0.5)), out.splitlines(), strict=True):
        number, row, joint = re.findall(r": ([\d.e+]+) .*: (\w+) of (\w+) at", line)[0]
        assert float(number) == pytest.approx(bound.value, rel=1e-3)
        assert (row, joint) == (bound.row, bound.joint)
