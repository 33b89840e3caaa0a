"""What an operator may do on the way: stop and go on, say not yet, and name another foothold."""

from __future__ import annotations

import functools

import numpy as np
import pytest

from tests.climb.arriving import arrives
from tests.climb.by_hand import TRIPODS, gait
from tests.climb.walkers import over
from wbc.climb import BodyPlace, ClimbScene, ContactMove, ContactPlan, Stance, machines, plan_climb
from wbc.climb.along import BodyTrack, plan_along
from wbc.climb.grids import cylinder_grid
from wbc.climb.loop import ClimbLoop, ClimbOutcome, LimbState


@functools.cache
def walked() -> ContactPlan:
    """The published walker along its cylinder, fast."""
    scene = cylinder_grid()
    ends = over(13, 8), over(15, 15)
    return plan_along(machines.climber("walker"), scene, BodyTrack(ends, 0.15))


@pytest.mark.parametrize("seed", range(4))
def test_a_robot_stops_along_its_plan_and_goes_on(seed: int) -> None:
    plan, rng = gait(TRIPODS) if seed == 0 else walked(), np.random.default_rng(seed)
    loop = ClimbLoop(plan, backend="vm")
    for _ in range(8):
        for _ in range(int(rng.integers(1, 120))):
            if not loop.ended:
                loop.tick()
        if loop.ended:
            break
        begin, aloft = loop.path_time, [state not in (LimbState.HELD, LimbState.UNLOADING) for state in loop.states]
        loop.stop("the operator stopped it")
        assert loop.stopped == "the operator stopped it"
        until = loop.time + 0.6
        while not loop.still:
            loop.tick()
            assert loop.time < until
        at, states = loop.path_time, loop.states
        lifted = [move for move in plan.moves if begin < move.lift <= at]
        # A lift that is nearer than the joints can stop comes; no other does
        assert all(move.lift - begin < 0.05 for move in lifted)
        assert at - begin < 0.3
        for _ in range(20):
            loop.tick()
        assert loop.path_time == at
        assert loop.states == states
        assert len(aloft) == len(states)
        loop.carry_on()
    run = loop.run(most=60.0)
    arrives(run, plan.climber, plan.scene)
    assert len(run.plans) == 1


def test_a_lift_waits_for_a_yes() -> None:
    plan = walked()
    loop, asked = ClimbLoop(plan, backend="vm"), list[ContactMove]()

    def approve(move: ContactMove) -> str | None:
        asked.append(move)
        # Each one is thought about for half a second
        return "" if sum(other is move for other in asked) > 50 else None

    loop.approve = approve
    waits = 0
    while not loop.ended:
        waits += loop.waiting is not None
        if loop.waiting is not None:
            assert loop.waiting in loop.coming
            assert LimbState.SWINGING not in [loop.states[loop.waiting.limb]]
        loop.tick()
        assert loop.time < 60.0
    run = loop.result()
    arrives(run, plan.climber, plan.scene)
    assert waits > 30 * len(plan.moves)
    assert {id(move) for move in asked} == {id(move) for move in plan.moves}


def test_another_foothold_is_taken_where_the_limb_can_go_there() -> None:
    plan = walked()
    first = plan.moves[0]
    scene, climber = plan.scene, plan.climber

    def rest(scene: ClimbScene, stance: Stance) -> ContactPlan:
        return plan_climb(climber, scene, stance, BodyPlace(climber.body_pose(plan.q[-1]).translation))

    loop = ClimbLoop(plan, replan=rest, backend="vm")
    near = np.argsort(np.linalg.norm(scene.positions - scene.positions[first.lands], axis=1))[1:9]
    held = [scene.footholds[row].id for row in plan.start]
    names = [
        "no such hold",
        held[first.limb - 1],
        "1,1",
        *(scene.footholds[row].id for row in near if row not in plan.start),
    ]
    refused = dict[str, str]()

    def approve(move: ContactMove) -> str | None:
        if len(loop.result().plans) > 1 or loop.plan is not plan:
            return ""
        if asked and loop.refused:
            refused[asked[-1]] = loop.refused
        asked.append(names.pop(0))
        return asked[-1]

    asked = list[str]()
    loop.approve = approve
    run = loop.run(most=60.0)
    arrives(run, climber, scene)
    assert list(refused)[:3] == asked[:3]
    assert "no such hold" in refused["no such hold"]
    assert "out of reach" in refused["1,1"]
    chosen = run.plans[1].moves
    assert [(move.limb, scene.footholds[move.lands].id) for move in chosen] == [(first.limb, asked[-1])]
    assert len(run.plans) == 3
    assert loop.refused == ""


def test_a_choice_without_a_planner_ends_the_run() -> None:
    plan = walked()
    loop = ClimbLoop(plan, backend="vm")
    row = next(k for k in np.argsort(np.linalg.norm(plan.scene.positions - plan.scene.positions[plan.moves[0].leaves],
                                                    axis=1)) if k not in plan.start)  # fmt: skip
    loop.approve = lambda move: plan.scene.footholds[row].id
    run = loop.run(most=30.0)
    assert run.outcome is ClimbOutcome.STOPPED
    assert run.reason == "another foothold was chosen, and no planner was given"
