"""Every loop on a robot that lags: track, climb and teleoperation take another plant, and stay what they are."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

import wbc
from tests.climb.by_hand import climber, gait
from tests.models import placement
from tests.simulation.lagging import LaggingPlant
from wbc import track
from wbc.climb.checker import check
from wbc.climb.loop import ClimbLoop
from wbc.errors import ShapeError
from wbc.simulation import KinematicPlant
from wbc.teleop import Order, Teleoperation, run_session

#: Lag of a servo [s], delay in milliseconds, and noise of an encoder [rad]: slow, and quick
SERVO, QUICK = (0.02, 5, 2e-5), (0.01, 2, 1e-6)


def test_a_tracked_path_lags_and_ends_where_it_ends() -> None:
    robot = wbc.robots.load("panda")
    start = placement(robot, "panda_hand_tcp", robot.neutral)
    there = pin.SE3(start.rotation, start.translation + np.array([0.0, 0.1, -0.1]))
    plan = track.PathRun(
        robot, "panda_hand_tcp", track.SplinePath([0.0, 1.5], [start, there]), "line", robot.neutral, dt=0.01
    )
    exact, lagging = track.track(plan), track.track(plan, plant=LaggingPlant(robot, *SERVO))
    assert len(exact) == len(lagging) == plan.ticks
    assert lagging.meta["integration"] == "plant LaggingPlant"
    errors = [np.linalg.norm(log.array("pose")[:, :3] - log.array("target")[:, :3], axis=1) for log in (exact, lagging)]
    assert errors[0].max() < 1e-4
    assert 5e-4 < errors[1].max() < 5e-3
    assert errors[1][-1] < 2e-3
    again = track.track(plan, plant=LaggingPlant(robot, *SERVO))
    assert (again.array("q") == lagging.array("q")).all()


class Steady:
    """Orders of a constant rate."""

    def order(self, time: float, names: object, active: str, units: object) -> Order:
        return Order((0.02,))


def test_an_operator_drives_a_lagging_arm() -> None:
    session = Teleoperation("spherical_4r", acceleration=0.5, seconds=0.5)
    q, names = np.array([0.3, 0.5, -0.7, 1.1]), session.robot
    logs = [
        run_session(session, Steady(), q, seconds=2.0, plant=plant)
        for plant in (None, KinematicPlant(names), LaggingPlant(names, *SERVO))
    ]
    assert (np.array(logs[0].q) == np.array(logs[1].q)).all()
    apart = np.abs(np.array(logs[2].q) - np.array(logs[0].q)).max()
    assert 1e-4 < apart < 0.02
    assert set(logs[2].status) == {"solved"}


@pytest.mark.parametrize("name", ["hexapod", "wall_climber"])
def test_a_climb_on_servos_comes_to_its_end(name: str) -> None:
    """Limbs close later, and stay where they closed."""
    plan = gait([(0,), (3,)], 0.02, machine=climber(name))
    run = ClimbLoop(plan, LaggingPlant(plan.climber.robot, *QUICK)).run(10.0)
    assert run.outcome == "arrived", run.reason
    assert plan.times[-1] < run.log["t"][-1] < plan.times[-1] + 0.5
    rules = {finding.rule: finding for finding in check(run.log, plan.climber, plan.scene).findings}
    slips = "closed grip slips" if name == "wall_climber" else "closed contact slips"
    for rule in ("closed contact off its foothold", slips):
        assert rules[rule].kept, str(rules[rule])


def test_a_plant_of_another_robot_is_refused_everywhere() -> None:
    other = KinematicPlant(wbc.robots.load("ur5"))
    robot, steps = wbc.robots.load("panda"), gait([(0,), (3,)])
    plan = track.PathRun(robot, "panda_hand_tcp", track.SplinePath([0.0, 1.0], [np.eye(4)] * 2), "none", robot.neutral)
    with pytest.raises(ShapeError, match=r"plant\.nq"):
        track.track(plan, plant=other)
    with pytest.raises(ShapeError, match=r"plant\.nq"):
        ClimbLoop(steps, other)
    session = Teleoperation("spherical_4r", acceleration=0.5)
    with pytest.raises(ShapeError, match=r"plant\.nq"):
        run_session(session, Steady(), session.robot.neutral, plant=other)
