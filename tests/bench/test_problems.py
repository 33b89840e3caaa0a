"""The benchmark's problems: shared descriptions are the robots, and answers are those of an independent QP."""

from __future__ import annotations

import functools
from math import inf
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

import wbc
from bench import prepare, worker
from bench.ours import Ours
from bench.problems import Case, load
from bench.reference import Referee
from tests.bench.independent import clearances, stated, worst_error
from tests.judges.quadprog_qp import referee as by_quadprog
from tests.repeats import ALL, MORE

MAKERS = {"panda": prepare.panda, "talos": prepare.talos} | ({"ur5": prepare.ur5} if MORE >= ALL else {})


@pytest.fixture(scope="module", params=MAKERS)
def case(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Case:
    """Each problem, written and read back."""
    return load(MAKERS[request.param](tmp_path_factory.mktemp("bench") / request.param))


@pytest.fixture(scope="module")
def ours(case: Case) -> Ours:
    """This package on it, with the linear model that the problem states."""
    return Ours(case, calm=False)


def test_shared_description_is_the_robot(case: Case) -> None:
    robot = wbc.robots.load(case.problem.robot)
    model = Referee(case).model
    rng = np.random.default_rng(1)
    data, other = robot.model.createData(), model.createData()
    for _ in range(5):
        q = pin.integrate(model, case.q0, rng.normal(size=model.nv))
        pin.framesForwardKinematics(robot.model, data, q)
        pin.framesForwardKinematics(model, other, q)
        for frame in case.problem.frames:
            found, wanted = other.oMf[model.getFrameId(frame)], data.oMf[robot.model.getFrameId(frame)]
            np.testing.assert_allclose(found.homogeneous, wanted.homogeneous, atol=1e-12)
        if case.problem.com:
            np.testing.assert_allclose(
                pin.centerOfMass(model, other, q), pin.centerOfMass(robot.model, data, q), atol=1e-9
            )
    joints = slice(6 if case.problem.floating else 0, None)
    np.testing.assert_array_equal(model.upperVelocityLimit[joints], robot.limits.velocity[joints])


def test_paths_make_limits_bind_and_come_to_rest(case: Case) -> None:
    referee = Referee(case)
    qp = stated(referee, case.q0, 0)
    first, speed = by_quadprog(qp), referee.model.upperVelocityLimit
    assert first is not None
    assert np.any(np.abs(first) > speed * (1 - 1e-9))
    np.testing.assert_array_equal(case.poses[-1], case.poses[-prepare.REST])


def test_answers_are_exact_solutions_of_the_qp_that_was_built(ours: Ours) -> None:
    assert worst_error(ours) < 1e-6


def test_answers_are_those_of_an_independent_build_of_the_qp(case: Case) -> None:
    # What `calm` adds to the QP is not in the problem
    assert worst_error(Ours(case, calm=False), functools.partial(stated, Referee(case))) < 1e-6


def test_path_is_followed_clear_of_obstacles(ours: Ours) -> None:
    case, referee = ours.case, Referee(ours.case)
    states = worker.time_sample(ours, inf)["states"]
    position, rotation = referee.errors(np.array(states[-1]), case.ticks - 1)
    assert position < 3e-3
    assert rotation < 1e-3
    if case.problem.pairs:
        least = []
        for state in states:
            referee.update(np.array(state))
            least.append(clearances(referee)[0].min())
        # The margin is kept, and reached: the obstacles are in the way
        assert min(least) > case.problem.margin - 1e-5
        assert min(least) < case.problem.margin + 1e-3


def test_workers_time_every_tick(ours: Ours) -> None:
    times = worker.time_calls(ours, 20)
    assert {"call", "cycle"} <= set(times)
    assert all(len(values) == 20 and min(values) > 0 for values in times.values())


def test_problem_folder_is_complete(case: Case) -> None:
    folder = case.urdf.parent
    assert {p.name for p in Path(folder).iterdir()} >= {"problem.json", "targets.npz", "robot.urdf"}
    assert case.poses.shape == (prepare.TICKS, len(case.problem.frames), 4, 4)
