"""Plans of climbers on scenes that are drawn, and what is carried out of them, as Pinocchio and Coal alone see them."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

from bench.climb.structures import OBSTRUCTED, structure
from tests.climb.arriving import arrives
from tests.climb.referee import between, body_speeds, fastest_share, least_distances, off, slipped
from tests.climb.walkers import walker_with
from tests.repeats import MORE, repeats
from wbc.climb import (
    BodyPlace,
    Climber,
    ClimbLoop,
    ClimbOptions,
    ContactPlan,
    Equilibrium,
    MotionOptions,
    NoStancesError,
    StanceOptions,
    first_stance,
    machines,
    plan_climb,
)
from wbc.climb.along import AlongOptions, BodyTrack, plan_along
from wbc.climb.motion import MoveError
from wbc.climb.path_loads import LEAST
from wbc.climb.places import body_over
from wbc.climb.scene import size_of
from wbc.climb.scenes import ClimbCourse, draw, placed
from wbc.climb.time_law import MotionSpeeds

#: Climbers, and scenes of their kind
KINDS = (
    (("anymal_c", "a1", "hexapod", "octopod"), ("stepping_stones", "rubble", "stairs")),
    (("walker", "truss_climber", "three_pandas"), ("cylinder", "truss")),
    (("wall_climber", "hexapod_grips"), ("wall", "cylinder")),
)
#: Instants of a plan at which Coal looks
INSTANTS = 12
#: Numbers of arms of walkers among obstacles, seed by seed
ARMS = (3, 3, 3, 4, 3, 3, 6, 3, 5, 3)


def sound(plan: ContactPlan, speeds: MotionSpeeds) -> None:
    """Contacts, limits, speeds and clearances between knots."""
    times, q = between(plan, 3)
    assert slipped(plan, times, q) < 1e-4
    velocity, acceleration = fastest_share(plan, times, q)
    assert velocity < speeds.share * 1.001
    assert acceleration < speeds.acceleration_share * 1.02
    speed, turn = body_speeds(plan, times, q)
    assert speed <= speeds.speed * (1 + 1e-3)
    assert turn <= speeds.turn_rate * (1 + 1e-3)
    own, other = least_distances(plan, q[:: max(1, len(q) // INSTANTS)])
    assert own > -1e-4
    assert other > 0.01 - 1e-4


def carried_out(plan: ContactPlan) -> None:
    """It arrives, the checker finds nothing, and neither do Pinocchio and Coal, which look between ticks too."""
    run = ClimbLoop(plan, backend="vm").run()
    arrives(run, plan.climber, run.scene)
    model, q, contacts = plan.climber.robot.model, run.log.array("q"), run.log.array("contact").astype(int)
    some = range(0, len(q) - 1, max(1, len(q) // INSTANTS))
    between_ticks = [pin.integrate(model, q[k], 0.5 * pin.difference(model, q[k], q[k + 1])) for k in some]
    own, other = least_distances(plan, np.array(between_ticks))
    assert min(own, other) > 0.0
    for k, posture in zip(some, between_ticks, strict=True):
        for limb, row in enumerate(contacts[k]):
            if row >= 0 and row == contacts[k + 1, limb]:
                assert off(plan, limb, row, posture) < 2e-3


def planned(climber: Climber, course: ClimbCourse, share: float, speeds: MotionSpeeds) -> ContactPlan | None:
    """A share of the way over stances; None where it is refused, by a typed error."""
    first, last = (body_over(climber, frame) for frame in (course.start, course.goal))
    options = ClimbOptions(StanceOptions(moves=600), MotionOptions(speeds=speeds), again=10)
    try:
        start = first_stance(climber, course.scene, climber.with_body(climber.rest, first))
        goal = BodyPlace(first.translation + share * (last.translation - first.translation))
        return plan_climb(climber, course.scene, start, goal, options)
    except (NoStancesError, MoveError):
        return None


@pytest.mark.parametrize("seed", range(repeats(3)))
def test_plans_over_stances_are_sound(seed: int) -> None:
    """At random speeds, on random scenes of which some are sparse."""
    rng = np.random.default_rng([5, seed])
    names, families = KINDS[seed % len(KINDS)]
    climber = machines.climber(str(rng.choice(names)))
    size, family, density = size_of(climber), str(rng.choice(families)), float(rng.uniform(0.6, 1.0))
    speeds = MotionSpeeds(float(rng.uniform(0.05, 0.4)) * size, float(rng.uniform(0.05, 0.4)))
    plan = planned(climber, draw(family, size, seed, density), float(rng.uniform(0.1, 0.3)), speeds)
    if plan is not None:
        sound(plan, speeds)
        carried_out(plan)


@pytest.mark.parametrize("seed", range(repeats(3)))
def test_plans_along_ways_are_sound(seed: int) -> None:
    """Of random ways and turns over random footholds; the body is nowhere faster than asked."""
    rng = np.random.default_rng([6, seed])
    climber = machines.climber(("walker", "hexapod", "wall_climber")[seed % 3])
    size = size_of(climber)
    course = draw(("cylinder", "stepping_stones", "wall")[seed % 3], size, seed, density=float(rng.uniform(0.8, 1.0)))
    first, last = (body_over(climber, frame).translation for frame in (course.start, course.goal))
    ahead = rng.uniform(0.1, 0.2) * (last - first)
    speeds = MotionSpeeds(float(rng.uniform(0.03, 0.1)) * size, 0.1)
    try:
        start = first_stance(climber, course.scene, placed(climber, course.start))
        begin = climber.body_pose(start.q)
        track = BodyTrack((begin, pin.SE3(begin.rotation, begin.translation + ahead)), speeds.speed, speeds.turn_rate)
        plan = plan_along(climber, course.scene, track, start, AlongOptions(MotionOptions(speeds=speeds)))
    except NoStancesError:
        return
    sound(plan, speeds)
    carried_out(plan)


@pytest.mark.parametrize("family", OBSTRUCTED)
def test_what_stands_in_the_way_is_missed(family: str) -> None:
    """Of each family the beginning of the first way that is found; of a long run several whole ones, with more arms."""
    walked, seed = 0, 0
    while walked < (repeats(1) if MORE > 1.0 else 1) and seed < 10 * repeats(1):
        climber, course = walker_with(ARMS[seed % len(ARMS)]), structure(family, seed)
        plan = planned(climber, course, 1.0 if MORE > 1.0 else 0.3, MotionSpeeds(0.1, 0.2))
        if plan is not None:
            sound(plan, MotionSpeeds(0.1, 0.2))
            carried_out(plan)
            walked += 1
        seed += 1
    assert walked > 0


def test_equilibrium_holds_between_the_points_at_which_it_was_looked_at() -> None:
    """One of these moves is so near to where its grip gives way that four of its fifteen seconds lie between two."""
    climber = machines.climber("truss_climber")
    course = draw("rubble", size_of(climber))
    start = first_stance(climber, course.scene, placed(climber, course.start))
    goal = BodyPlace(climber.body_pose(placed(climber, course.goal)).translation)
    plan, balance = plan_climb(climber, course.scene, start, goal), Equilibrium(climber, course.scene)
    least = [balance.margin(plan.contacts_at(t), q) for t, q in zip(plan.times[::7], plan.q[::7], strict=True)]
    assert min(least) >= 0.9 * min(plan.margin, LEAST)
