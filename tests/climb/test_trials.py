"""Trials of the loop from seeds, each judged by the checker: bodies driven by random rates, climbs that go on from
their logs, footholds that vanish, limbs that fail, bodies that appear, stops; walks of the benchmark of the published
walker: layouts, structures, structures with six arms, and structures of other families. A handful here, hundreds with
``make soak REPEATS=30``; the checker finds nothing.
"""

from __future__ import annotations

import functools
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

from bench.climb.walker import cases, walked
from tests.climb.walkers import over
from tests.repeats import repeats
from wbc.climb import BodyPlace, ClimbScene, ContactPlan, Stance, first_stance, machines, plan_climb
from wbc.climb.along import BodyTrack, plan_along
from wbc.climb.checker import check
from wbc.climb.climber import Climber
from wbc.climb.drive import ClimbDrive, standing_plan
from wbc.climb.grids import cylinder_grid
from wbc.climb.let_go import joined
from wbc.climb.loop import ClimbLoop, ClimbOutcome, ClimbRun
from wbc.climb.motion import MoveError
from wbc.climb.resume import coming_to_rest, stance_in
from wbc.climb.scene import SceneBody, size_of
from wbc.climb.scenes import draw, placed
from wbc.climb.search import NoStancesError
from wbc.shapes import Sphere

#: Robots and what they climb
GROUNDS = (
    ("walker", "cylinder_grid"), ("walker", "truss"), ("hexapod", "stepping_stones"), ("walker", "cylinder"),
    ("three_pandas", "cylinder"), ("hexapod_grips", "wall"), ("truss_climber", "rebar"),
    ("anymal_c", "stepping_stones"),
)  # fmt: skip
#: Rates of a driven body, at most: in sizes of the robot, and turns [1/s, rad/s]
RATES = np.array([0.08, 0.08, 0.0, 0.0, 0.0, 0.1])
#: Times between changes of the rates [s], and how long a body is driven [s]
CHANGES, DRIVEN = (0.05, 3.0), 12.0
#: Time in which a run ends after all has happened [s]
ENDS = 90.0


@dataclass(frozen=True, eq=False)
class Ground:
    """A robot where it stands, and a place to which it could go."""

    climber: Climber
    scene: ClimbScene
    start: Stance
    goal: pin.SE3
    size: float


@functools.cache
def ground(name: str, family: str, seed: int) -> Ground:
    """One of those of ``GROUNDS``."""
    climber = machines.climber(name)
    if family == "cylinder_grid":
        scene = cylinder_grid()
        begin, goal = over(13, 8 + seed % 3), over(13 + seed % 2, 13)
        q, size = climber.with_body(climber.rest, begin), 1.5
        return Ground(climber, scene, first_stance(climber, scene, q), goal, size)
    size = size_of(climber)
    course = draw(family, size, seed)
    start = first_stance(climber, course.scene, placed(climber, course.start))
    return Ground(climber, course.scene, start, climber.body_pose(placed(climber, course.goal)), size)


def drive(seed: int) -> dict[str, Any]:
    """Rates that change every so often; then the body comes to rest."""
    rng = np.random.default_rng([1, seed])
    at = ground(*GROUNDS[seed % len(GROUNDS)], seed // len(GROUNDS) % 3)
    every = float(np.exp(rng.uniform(*np.log(CHANGES))))
    round_ = at.size == 1.5 and seed % 16 == 0
    driven = ClimbDrive(at.climber)
    loop = ClimbLoop(standing_plan(at.climber, at.scene, at.start), replan=driven.following, onward=driven.onward,
                     backend="vm")  # fmt: skip
    changed = 0.0
    while not loop.ended and loop.time < DRIVEN + ENDS:
        if loop.time >= DRIVEN:
            driven.finish(loop)
        elif loop.time >= changed:
            twist = rng.uniform(-1.0, 1.0, 6) * RATES * [*[at.size] * 3, 1.0, 1.0, 1.0]
            if round_:
                about = np.array([0.0, 0.0, twist[0], 0.0, 0.0, 0.3 * twist[5]])
                twist = at.climber.body_pose(loop.stance.q).toActionMatrixInverse() @ about
            driven.steer(twist, loop)
            changed += every
        loop.tick()
    return judged(loop.result(), at)


def resume(seed: int) -> dict[str, Any]:
    """A climb that is broken off at any instant, or just after a lift or landing, and goes on from there."""
    rng = np.random.default_rng([2, seed])
    at = ground(*GROUNDS[seed % len(GROUNDS)], seed // len(GROUNDS) % 3)
    run = ClimbLoop(first_plan(at, seed), backend="vm").run()
    t = run.log["t"]
    when = float(rng.uniform(t[1], t[-1]))
    if seed % 2 and run.changes:
        when = min(float(run.changes[int(rng.integers(len(run.changes)))][0] + rng.uniform(0.0, 0.05)), float(t[-1]))
    stance = stance_in(run.log, at.climber, at.scene, when)
    rest = coming_to_rest(run.log, at.climber, at.scene, when)
    try:
        plan = onward(at)(at.scene, stance if rest is None else replace(stance, q=rest.q[-1]))
    except (NoStancesError, MoveError) as error:
        return {"outcome": "refused", "reason": str(error), "violations": []}
    plan = plan if rest is None else joined(rest, plan)
    return judged(ClimbLoop(plan, backend="vm").run(), at)


def vanish(seed: int) -> dict[str, Any]:
    """Footholds vanish that are held, that limbs are on their way to, or many at once; a limb fails; bodies appear."""
    rng = np.random.default_rng([3, seed])
    at = ground(*GROUNDS[seed % len(GROUNDS)], seed // len(GROUNDS) % 3)
    plan = first_plan(at, seed)
    whens = list(np.sort(rng.uniform(0.2, plan.times[-1], int(rng.integers(1, 4)))))
    what = ("held", "coming", "many", "body", "fail")[int(rng.integers(5))]
    bears = len(at.climber.limbs) - 1 if at.climber.limbs[0].contact.pulls else len(at.climber.limbs)

    def before_tick(loop: ClimbLoop) -> None:
        if not whens or loop.time < whens[0]:
            return
        whens.pop(0)
        scene = loop.scene
        held = [k for k in loop.stance.contacts if k >= 0]
        coming = {loop.plan.scene.footholds[move.lands].id for move in loop.coming if move.lands >= 0}
        coming -= {scene.footholds[k].id for k in held}
        ids = {foothold.id for foothold in scene.footholds}
        if what == "held" and len(held) > bears:
            loop.see(scene.without(scene.footholds[int(rng.choice(held))].id))
        elif what == "coming" and coming & ids:
            loop.see(scene.without(sorted(coming & ids)[0]))
        elif what == "many":
            own = {scene.footholds[k].id for k in held}
            gone = [foothold.id for foothold in scene.footholds if foothold.id not in own and rng.random() < 0.1]
            for name in gone:
                scene = scene.without(name)
            loop.see(scene)
        elif what == "body":
            place = at.climber.body_pose(loop.stance.q).translation + rng.uniform(1.0, 2.0) * at.size * np.eye(3)[2]
            ball = SceneBody(Sphere(0.1 * at.size), pin.SE3(np.eye(3), place))
            loop.see(replace(scene, bodies={**scene.bodies, f"ball {loop.time:.2f}": ball}))
        elif what == "fail" and at.climber.limbs[0].contact.pulls and len(at.climber.limbs) > 3:
            loop.fail(at.climber.limbs[int(rng.integers(len(at.climber.limbs)))].name)

    loop = ClimbLoop(plan, replan=onward(at), backend="vm")
    return judged(loop.run(most=float(plan.times[-1]) + ENDS, before_tick=before_tick), at)


def stop(seed: int) -> dict[str, Any]:
    """A climb that is stopped again and again, and goes on."""
    rng = np.random.default_rng([4, seed])
    at = ground(*GROUNDS[seed % len(GROUNDS)], seed // len(GROUNDS) % 3)
    loop, then = ClimbLoop(first_plan(at, seed), backend="vm"), 0.0
    while not loop.ended and loop.time < 300.0:
        if loop.time >= then:
            then = loop.time + float(np.exp(rng.uniform(np.log(0.02), np.log(3.0))))
            if loop.stopped:
                loop.carry_on()
            else:
                loop.stop("stopped by the trial")
        loop.tick()
    return judged(loop.result(), at)


def first_plan(at: Ground, seed: int) -> ContactPlan:
    """Along a way without a stop where there is one, on every second seed; else from stance to stance."""
    if seed % 4 < 2:
        begin = at.climber.body_pose(at.start.q)
        ahead = at.goal.translation - begin.translation
        ahead *= min(1.0, 0.8 * at.size / np.linalg.norm(ahead))
        try:
            track = BodyTrack((begin, pin.SE3(begin.rotation, begin.translation + ahead)), 0.07 * at.size)
            return plan_along(at.climber, at.scene, track, at.start)
        except NoStancesError:
            pass
    return onward(at)(at.scene, at.start)


def onward(at: Ground) -> Callable[[ClimbScene, Stance], ContactPlan]:
    """What plans to the goal, or a size of the robot towards it."""
    begin = at.climber.body_pose(at.start.q).translation
    ahead = at.goal.translation - begin
    goal = begin + ahead * min(1.0, at.size / np.linalg.norm(ahead))

    def plan(scene: ClimbScene, stance: Stance) -> ContactPlan:
        return plan_climb(at.climber, scene, stance, BodyPlace(goal))

    return plan


def judged(run: ClimbRun, at: Ground) -> dict[str, Any]:
    """What the checker finds in a run, and how it ended."""
    report = check(run.log, at.climber, replace(run.scene, bodies=run.plans[-1].scene.bodies))
    last = run.log.array("contact")[-1]
    return {
        "outcome": str(run.outcome), "reason": run.reason, "violations": [str(f) for f in report.violations],
        "hanging": int((last < 0).sum()),
    }  # fmt: skip


def walk(part: str, arms: int | None, seed: int) -> dict[str, Any]:
    """A case of :mod:`bench.climb.walker`, planned, carried out and checked."""
    record = walked(next(cases(part, 1, arms, seed)))
    outcome = "refused" if not record["planned"] else "arrived" if record["arrived"] else "stopped"
    return record | {"outcome": outcome, "violations": record.get("violations", [])}


KINDS: dict[str, Callable[[int], dict[str, Any]]] = {
    "drive": drive, "resume": resume, "vanish": vanish, "stop": stop,
    "layout": functools.partial(walk, "layouts", None), "structure": functools.partial(walk, "structures", None),
    "six_arms": functools.partial(walk, "structures", 6), "other": functools.partial(walk, "families", None),
}  # fmt: skip


def wrong(kind: str, record: dict[str, Any]) -> bool:
    """Whether a trial shows a fault: a violation, a run that does not end, a limb that is left in the air."""
    ended = str(ClimbOutcome.OUT_OF_TIME) != record["outcome"]
    stops = kind not in ("resume", "vanish") and record["outcome"] == str(ClimbOutcome.STOPPED)
    arrives = kind in ("drive", "stop") and record["outcome"] != str(ClimbOutcome.ARRIVED)
    return bool(record["violations"]) or not ended or arrives or stops or (kind == "drive" and record["hanging"] > 0)


#: Seeds of each kind that are tried first: the quick ones
FIRST = {"drive": (0, 2), "resume": (3, 15), "vanish": (0, 23), "stop": (6, 0),
         "layout": (0, 9), "structure": (1, 2), "six_arms": (1, 2), "other": (1, 2)}  # fmt: skip


@pytest.mark.parametrize("kind", KINDS)
def test_nothing_is_violated(kind: str) -> None:
    for seed in (*FIRST[kind], *range(100, 100 + repeats(1)))[: repeats(1)]:
        record = KINDS[kind](seed)
        assert not wrong(kind, record), (seed, record)
