"""Every loop on a robot that lags: track, walk, drive and teleoperation take another plant, and stay what they are."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

import wbc
from tests.simulation.lagging import LaggingPlant
from wbc import track
from wbc.errors import ShapeError
from wbc.robots import Walker
from wbc.simulation import KinematicPlant
from wbc.teleop import Order, Teleoperation, run_session
from wbc.walking import Structure, cylinder
from wbc.walking.body_path import grid_path
from wbc.walking.checker import check_walk
from wbc.walking.loop.stack import WalkStack
from wbc.walking.loop.walk import Tick, Walk
from wbc.walking.modes.drive import Drive, standing_plan
from wbc.walking.planner.planner import plan_walk
from wbc.walking.run.recording import WalkRecorder

#: Lag of a servo [s], delay in milliseconds, and noise of an encoder [rad]: slow, quick, and very slow
SERVO, QUICK, SLOW = (0.02, 5, 2e-5), (0.01, 2, 1e-6), (0.05, 10, 0.0)


@pytest.fixture(scope="module")
def machine() -> Walker:
    return wbc.robots.walker()


@pytest.fixture(scope="module")
def structure() -> Structure:
    return cylinder(rigid=True)


@pytest.fixture(scope="module")
def stack(machine: Walker, structure: Structure) -> WalkStack:
    return WalkStack(machine, structure, collisions=False)


def test_a_tracked_path_lags_and_ends_where_it_ends() -> None:
    robot = wbc.robots.load("panda")
    data = robot.model.createData()
    pin.framesForwardKinematics(robot.model, data, robot.neutral)
    start = data.oMf[robot.model.getFrameId("panda_hand_tcp")].copy()
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


def test_a_walk_on_servos_is_judged_by_the_checker(
    machine: Walker, structure: Structure, stack: WalkStack, tmp_path: Path
) -> None:
    plan, ends = plan_walk(machine, structure, grid_path([(13, 9), (13, 14)], 0.1016)), []
    for plant in (KinematicPlant(machine.robot), LaggingPlant(machine.robot, *QUICK)):
        walk, ticks = Walk(machine, structure, plan, stack=stack, plant=plant), list[Tick]()
        recorder = WalkRecorder(walk)

        def keep(tick: Tick, recorder: WalkRecorder = recorder, ticks: list[Tick] = ticks) -> None:
            recorder.tick(tick)
            ticks.append(tick)

        assert walk.run(keep) == "arrived"
        report = check_walk(recorder.log()[0], machine.urdf(tmp_path / "robot.urdf"), structure)
        assert report.ok, str(report)
        assert len(walk.progress.steps) >= 1
        ends.append((walk.time, max(tick.slip for tick in ticks), max(tick.body_error for tick in ticks)))
    # Hands on their holds slip and the body is late, within what the rules allow; hands that lag wait over their holds
    assert ends[0][0] - 0.2 < ends[1][0] < ends[0][0] + 1.0
    assert ends[0][1] < 3e-5 < ends[1][1] < 3e-4
    assert ends[0][2] < 1e-4 < ends[1][2] < 2e-3


def test_slow_servos_walk_later_and_violate_nothing(
    machine: Walker, structure: Structure, stack: WalkStack, tmp_path: Path
) -> None:
    """How late they are shows in their motion, and gains are lower then; else a hand would not come to rest."""
    plan = plan_walk(machine, structure, grid_path([(13, 9), (13, 14)], 0.1016))
    walk = Walk(machine, structure, plan, stack=stack, plant=LaggingPlant(machine.robot, *SLOW))
    recorder = WalkRecorder(walk)
    assert walk.run(recorder.tick) == "arrived"
    assert walk.machine.lag == pytest.approx(SLOW[0] + SLOW[1] * 1e-3, rel=0.2)
    report = check_walk(recorder.log()[0], machine.urdf(tmp_path / "robot.urdf"), structure)
    assert report.ok, str(report)
    assert walk.time < 1.5 * plan.path.duration


def test_a_driven_body_on_servos(machine: Walker, structure: Structure, stack: WalkStack) -> None:
    pose = pin.SE3(grid_path([(13, 11), (13, 12)], 0.1).poses[0])
    plan = standing_plan(machine, structure, pose)
    walk = Walk(machine, structure, plan, stack=stack, plant=LaggingPlant(machine.robot, *SERVO))
    drive, begin = Drive(walk), walk.q[:3].copy()
    drive.steer(0.0, 0.05, 0.0)
    ticks = [drive.tick() for _ in range(600)]
    drive.steer(0.0, 0.0, 0.0)
    while not drive.standing and len(ticks) < 2000:
        ticks.append(drive.tick())
    assert drive.standing
    assert np.linalg.norm(walk.q[:3] - begin) > 0.2
    assert len(walk.progress.steps) >= 1
    assert max(tick.slip for tick in ticks) < 1e-3
    assert {str(tick.status) for tick in ticks} == {"solved"}


def test_a_plant_of_another_robot_is_refused_everywhere(
    machine: Walker, structure: Structure, stack: WalkStack
) -> None:
    other = KinematicPlant(wbc.robots.load("ur5"))
    robot = wbc.robots.load("panda")
    plan = track.PathRun(robot, "panda_hand_tcp", track.SplinePath([0.0, 1.0], [np.eye(4)] * 2), "none", robot.neutral)
    with pytest.raises(ShapeError, match=r"plant\.nq"):
        track.track(plan, plant=other)
    with pytest.raises(ShapeError, match=r"plant\.nq"):
        Walk(machine, structure, plan_walk(machine, structure, grid_path([(13, 9), (13, 9.5)], 0.1)), plant=other)
    session = Teleoperation("spherical_4r", acceleration=0.5)
    with pytest.raises(ShapeError, match=r"plant\.nq"):
        run_session(session, Steady(), session.robot.neutral, plant=other)
