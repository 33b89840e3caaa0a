"""Structures of scarce holds, from seeds: they are walked, and ways over stances are found again."""

from __future__ import annotations

import functools
import itertools
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest

from bench.climb.structures import SCARCE, structure
from tests.climb.arriving import arrives
from wbc.climb import BodyPlace, ClimbLoop, first_stance, machines, motion, plan_climb
from wbc.climb.checker import check
from wbc.climb.climber import Climber
from wbc.climb.grids import GRIDS
from wbc.climb.motion import MoveError, Mover
from wbc.climb.places import body_frames, body_over
from wbc.climb.scene import ClimbScene, SceneBody
from wbc.climb.search import StanceWay, find_stances
from wbc.climb.stance import FREE_LIMB, Stance
from wbc.climb.world import ClimbWorld, PostureOutcome
from wbc.shapes import Sphere


@functools.cache
def walker() -> Climber:
    return machines.climber("walker")


def asked(family: str, seed: int) -> tuple[ClimbScene, Stance, BodyPlace]:
    """The scene of a seed, a stance at its start, and its goal."""
    course = structure(family, seed)
    first, last = (body_over(walker(), frame) for frame in (course.start, course.goal))
    start = first_stance(walker(), course.scene, walker().with_body(walker().rest, first))
    return course.scene, start, BodyPlace(last.translation, last.rotation)


@pytest.mark.parametrize("family", SCARCE)
def test_structures_are_walked(family: str) -> None:
    scene, start, goal = asked(family, 0)
    plan = plan_climb(walker(), scene, start, goal)
    body = walker().body_pose(plan.q[-1])
    assert np.linalg.norm(body.translation - goal.position) < 0.02 + 1e-6
    assert np.linalg.norm(pin.log3(body.rotation.T @ goal.rotation)) < 0.02 + 1e-6
    if family == "islands":
        run = ClimbLoop(plan).run(most=2.0 * float(plan.times[-1]))
        assert run.outcome == "arrived"
        assert check(run.log, walker(), scene).clean


@pytest.mark.parametrize(
    ("name", "ends"), [("plane_grid", ("8,8", "8,13")), ("truss_grid", ("L2,6", "L2,11")), ("module", ("15,4", "15,7"))]
)
def test_built_in_grids_are_walked(name: str, ends: tuple[str, str]) -> None:
    scene = GRIDS[name]()
    first, last = body_frames(walker(), scene, ends)
    start = first_stance(walker(), scene, walker().with_body(walker().rest, first))
    plan = plan_climb(walker(), scene, start, BodyPlace(last.translation, last.rotation))
    assert plan.moves
    run = ClimbLoop(plan, backend="vm").run()
    arrives(run, walker(), scene)


def test_a_way_is_found_again_without_a_move() -> None:
    scene, start, goal = asked("islands", 1)
    way = StanceWay(walker(), scene, start, goal)
    path = way.found()
    contacts = [stance.contacts for stance in path.stances]
    assert contacts == [stance.contacts for stance in find_stances(walker(), scene, start, goal).stances]
    row = next(k for k in range(1, len(contacts) - 1) if contacts[k] != contacts[k + 1])
    forbidden = contacts[row], contacts[row + 1]
    # Where a limb goes to a foothold late, it goes elsewhere where it can
    limb = next(k for k in range(3) if forbidden[0][k] != forbidden[1][k])
    late = ((), limb, forbidden[1][limb])
    way.forbid(row, [late])
    other = [stance.contacts for stance in way.found().stances]
    assert other[: row + 1] == contacts[: row + 1]
    assert forbidden not in itertools.pairwise(other)
    assert all(stance[limb] != late[2] for stance in other)
    for one, after in itertools.pairwise(other):
        assert sum(a != b for a, b in zip(one, after, strict=True)) <= 1


def test_the_body_goes_round_what_is_in_its_way(monkeypatch: pytest.MonkeyPatch) -> None:
    scene, start, goal = asked("islands", 0)
    begin = walker().body_pose(start.q).translation
    ahead = (goal.position - begin) / np.linalg.norm(goal.position - begin)
    one, *_, other = find_stances(walker(), scene, start, BodyPlace(begin + 0.3 * ahead)).stances
    assert one.contacts == other.contacts
    middle, sides = begin + 0.15 * ahead, (np.cross([0.0, 0.0, 1.0], ahead), np.array([0.0, 0.0, 1.0]))

    def bowed(mover: Mover) -> float:
        """How far the body is off its straight way at most [m]."""
        timed, _ = mover.moved(one, other)
        places = np.array([walker().body_pose(q).translation for q in timed.q]) - begin
        return float(np.linalg.norm(places - np.outer(places @ ahead, ahead), axis=1).max())

    def blocked() -> Iterator[Mover]:
        """Movers past a ball that comes nearer to the middle of the way, from one side after the other."""
        for angle in np.arange(0.0, 2.0 * np.pi, 0.5):
            for far in np.arange(0.9, 0.2, -0.03):
                at = middle + far * (np.cos(angle) * sides[0] + np.sin(angle) * sides[1])
                ball = SceneBody(Sphere(0.05), pin.SE3(np.eye(3), at))
                mover = Mover(walker(), replace(scene, bodies={**scene.bodies, "ball": ball}))
                try:
                    assert bowed(mover) < 0.05
                except MoveError as error:
                    if not error.standing:
                        yield Mover(walker(), mover.scene, mover.options)
                    break

    assert bowed(Mover(walker(), scene)) < 0.05
    with monkeypatch.context() as straight:
        straight.setattr(motion, "ASIDES", ())
        mover = next(blocked())
    assert bowed(mover) > 0.02


def test_the_body_makes_way_for_a_limb_that_lifts() -> None:
    scene, start, _ = asked("islands", 0)
    model, q = walker().robot.model, start.q
    data = model.createData()
    pin.framesForwardKinematics(model, data, q)
    link = data.oMf[model.getFrameId("arm1_link4")].translation
    # Over its forearm, as low as the stance lets it be
    ball = SceneBody(Sphere(0.05), pin.SE3(np.eye(3), link + [0.0, 0.0, 0.14]))
    below = replace(scene, bodies={**scene.bodies, "ball": ball})
    world = ClimbWorld(walker(), below, start, clear=0.01)
    contacts, state = world.contacts(world.start), world.state_of(q)
    assert world.look(contacts, state)[0][1] >= 0.0
    assert world.stuck(contacts, state) == 1
    kept = contacts.copy()
    kept[walker().row("arm1")] = FREE_LIMB
    outcome, after, _, moves = world.lift(contacts, kept, 0.0, state)
    assert (outcome, moves) == (PostureOutcome.STANDS, True)
    assert world.stuck(contacts, after) == 0
    # Nor does it begin there
    near = first_stance(walker(), below, q)
    assert world.stuck(world.contacts(near.contacts), world.state_of(near.q)) == 0
