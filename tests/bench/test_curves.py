"""The growing problems: all contenders get the same solids, and answers are those of an independent QP."""

from __future__ import annotations

import functools
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

from bench import curves, worker
from bench.curve_report import TITLES
from bench.descriptions import solid_index
from bench.ours import Ours
from bench.problems import Case, load
from bench.reference import Referee
from bench.scenery import boxes_around, capsules, distances, link_boxes, spheres_around
from tests.bench.independent import stated, worst_error


@pytest.fixture(scope="module")
def cluttered(tmp_path_factory: pytest.TempPathFactory) -> Case:
    """A Panda's capsules against three spheres."""
    panda, folder = curves.by_name("panda"), tmp_path_factory.mktemp("bench") / "spheres"
    arm = capsules(panda)
    balls = spheres_around(panda, arm, curves.joint_path(panda), 3)
    curves.among(folder, "spheres", panda, arm + balls)
    return load(folder)


@pytest.fixture(scope="module")
def boxed(tmp_path_factory: pytest.TempPathFactory) -> Case:
    """A Panda's boxes against two boxes, measured."""
    panda, folder = curves.by_name("panda"), tmp_path_factory.mktemp("bench") / "boxes"
    own = link_boxes(panda)
    crates = boxes_around(panda, own, curves.joint_path(panda), 2)
    curves.among(folder, "boxes", panda, own + crates, 10)
    return load(folder)


def test_every_point_has_a_title_and_a_folder_of_its_own() -> None:
    found = curves.points()
    assert {point.curve for point in found} == set(TITLES)
    assert len({point.folder for point in found}) == len(found)


@pytest.mark.parametrize("name", ["cluttered", "boxed"])
def test_pinocchio_reads_the_same_solids(name: str, request: pytest.FixtureRequest) -> None:
    case: Case = request.getfixturevalue(name)
    problem, referee = case.problem, Referee(case)
    geometry = pin.buildGeomFromUrdf(referee.model, str(case.urdf), pin.GeometryType.COLLISION)
    names = [g.name for g in geometry.geometryObjects]
    numbers = [names.index(solid_index(problem.solids, k)) for k in range(len(problem.solids))]
    for a, b in problem.pairs:
        geometry.addCollisionPair(pin.CollisionPair(numbers[a], numbers[b]))
    found = pin.GeometryData(geometry)
    for q in curves.joint_path(curves.by_name("panda"))[::50]:
        pin.computeDistances(referee.model, referee.model.createData(), geometry, found, q)
        there = np.array([result.min_distance for result in found.distanceResults])
        referee.update(q)
        here = distances(referee.model, referee.data, problem.solids, problem.pairs)
        np.testing.assert_allclose(there, here, atol=1e-5)


@pytest.mark.parametrize(("name", "largest"), [("cluttered", 1e-6), ("boxed", 1e-3)])
def test_answers_are_those_of_an_independent_build_of_the_qp(
    name: str, largest: float, request: pytest.FixtureRequest
) -> None:
    # The damping at the border of the workspace, which the QP of the problem does not have, is switched off
    case = request.getfixturevalue(name)
    assert worst_error(Ours(case, calm=False), functools.partial(stated, Referee(case))) < largest


def test_samples_stop_at_the_budget(cluttered: Case) -> None:
    ours = Ours(cluttered)
    whole = worker.time_sample(ours, 60.0)
    assert len(whole["call"]) == len(whole["states"]) == cluttered.ticks
    assert len(worker.time_sample(ours, 0.0)["call"]) == 5
    position, rotation = Referee(cluttered).errors(np.array(whole["states"][-1]), cluttered.ticks - 1)
    assert max(position, rotation) < 1e-3


def test_links_of_the_humanoid_stay_clear_on_the_path(tmp_path: Path) -> None:
    curves.write_g1(tmp_path / "g1")
    case = load(tmp_path / "g1")
    assert len(case.problem.pairs) == 20
    joints = {name: case.q0[7 + k] for k, name in enumerate(case.problem.joints)}
    assert joints["left_shoulder_roll_joint"] == pytest.approx(0.25)
