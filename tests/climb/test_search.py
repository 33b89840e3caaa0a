"""Stances found, against equilibrium by another program, kinematics by Pinocchio and a search over all stances."""

from __future__ import annotations

from itertools import combinations, pairwise

import numpy as np
import pinocchio as pin
import pytest

from tests.climb.bearing import slack_by_scipy
from tests.climb.stones import reached_by_all, stones
from tests.repeats import repeats
from wbc.climb.balance import Equilibrium
from wbc.climb.clear import Clearances, climber_bodies
from wbc.climb.climber import Climber
from wbc.climb.first import first_stance
from wbc.climb.goal import BodyPlace, LimbAt, Route
from wbc.climb.machines import climber
from wbc.climb.scene import ClimbScene, Foothold, size_of
from wbc.climb.scenes import draw, placed
from wbc.climb.search import NoStancesError, StanceOptions, find_stances
from wbc.climb.stance import FREE_LIMB, Stance, StancePath
from wbc.climb.world import ClimbWorld, PostureOutcome
from wbc.errors import RangeError, ShapeError, UnknownNameError
from wbc.geometry.kernel import ShapeTable, distances
from wbc.robot.joint_values import beyond_limits
from wbc.symbolic.joint_steps import place


def check(robot: Climber, scene: ClimbScene, path: StancePath, margin: float = 0.02) -> None:
    """Contacts at footholds, limits, and equilibrium of limbs that stay at both ends of every move."""
    limits, index = robot.robot.limits, robot.robot.position_index
    rows = index >= 0
    for stance in path.stances:
        held = [row for row in stance.contacts if row >= 0]
        assert len(set(held)) == len(held)
        assert (stance.q[index[rows]] >= limits.position_lower[rows] - 1e-9).all()
        assert (stance.q[index[rows]] <= limits.position_upper[rows] + 1e-9).all()
        for limb, row in enumerate(stance.contacts):
            if row >= 0:
                pose, wanted = robot.contact_pose(stance.q, limb), scene.footholds[row].pose
                assert np.linalg.norm(pose.translation - wanted.translation) < 1e-7
                if robot.fixed(limb) != "position":
                    assert pose.rotation[:, 2] @ wanted.rotation[:, 2] > 1.0 - 1e-9
    balance = Equilibrium(robot, scene)
    for k, (before, after) in enumerate(pairwise(path.stances)):
        kept = [a if a == b else FREE_LIMB for a, b in zip(before.contacts, after.contacts, strict=True)]
        least = min(balance.margin(kept, stance.q) for stance in (before, after))
        # While the body shifts all contacts bear, some of which need not
        assert least >= (margin if before.contacts != after.contacts else 0.0) - 1e-6
        assert least == pytest.approx(path.margins[k + 1], abs=1e-6)
        if k % 10 == 0:
            assert least == pytest.approx(
                min(slack_by_scipy(robot, scene, kept, s.q) for s in (before, after)), abs=1e-6
            )


@pytest.mark.parametrize(
    ("name", "family"),
    [("anymal_c", "stepping_stones"), ("hexapod", "rubble"), ("walker", "cylinder"), ("wall_climber", "wall")],
)
def test_stances_through_a_course_stand(name: str, family: str) -> None:
    robot = climber(name)
    course = draw(family, size_of(robot), seed=0)
    start = first_stance(robot, course.scene, placed(robot, course.start))
    goal = BodyPlace(robot.body_pose(placed(robot, course.goal)).translation, within=0.1 * size_of(robot))
    path = find_stances(robot, course.scene, start, goal, StanceOptions(moves=2000))
    check(robot, course.scene, path)
    assert np.linalg.norm(robot.body_pose(path.stances[-1].q).translation - goal.position) <= goal.within + 1e-9
    assert path.stances[0] is start


@pytest.mark.parametrize(
    ("name", "family"),
    [("hexapod", "stepping_stones"), ("anymal_c", "stairs"), ("a1", "stairs"), ("a1", "rubble")],
)
def test_no_posture_of_the_search_is_one_that_motions_refuse(name: str, family: str) -> None:
    robot, stood = climber(name), 0
    for seed in range(repeats(2)):
        rng, course = np.random.default_rng(seed), draw(family, size_of(robot), seed)
        world, clearances = ClimbWorld(robot, course.scene, clear=0.01), Clearances(robot, course.scene)
        start = placed(robot, course.start)
        feet = np.array([robot.contact_pose(start, limb).translation for limb in range(len(robot.limbs))])
        for _ in range(60):
            on = course.scene.positions[rng.integers(len(course.scene.footholds))] - course.start.translation
            away = np.linalg.norm(world.places[:, None, 9:] - feet - on, axis=2)
            contacts = world.contacts([int(rng.choice(near)) for near in np.argsort(away, axis=0)[:12].T])
            contacts[rng.random(len(contacts)) < 0.1] = FREE_LIMB
            held = world.hold[contacts[contacts >= 0]]
            able = [at < 0 or world.cone_of[limb, at] >= 0 for limb, at in enumerate(contacts)]
            if len(set(held)) < len(held) or not all(able):
                continue
            state = world.state_of(start)
            state[9:12] += on + 0.15 * world.length * rng.uniform(-1.0, 1.0, 3)
            state[:9] = (state[:9].reshape(3, 3) @ pin.exp3(rng.uniform(-0.3, 0.3, 3))).ravel()
            outcome, state, _ = world.stand(contacts, contacts, 0.0, state, followed=False)
            if outcome == PostureOutcome.STANDS:
                rows = [int(world.hold[place]) if place >= 0 else FREE_LIMB for place in contacts]
                assert clearances.standing(rows, world.q_of(state)) is None
                stood += 1
    assert stood >= 5


def test_little_is_missed_on_few_stones() -> None:
    """The search over all stances looks at no way between postures but forbids limbs that hold to flip over, so that it
    may come to more than there is.
    """
    robots = [climber("hexapod"), climber("anymal_c"), climber("anymal_c")]
    found, agreed, missed = 0, 0, 0
    for seed in range(repeats(12)):
        rng = np.random.default_rng(seed)
        robot, options = robots[seed % 3], StanceOptions(margin=0.05, moves=2000)
        try:
            scene, start = stones(robot, rng, 1 if seed % 3 == 0 else 2, rng.uniform(0.8, 1.8) * size_of(robot))
        except NoStancesError:
            continue
        limb, target = int(rng.integers(len(robot.limbs))), len(scene.footholds) - 1
        goal = LimbAt(robot.limbs[limb].name, scene.footholds[target].id)
        try:
            check(robot, scene, find_stances(robot, scene, start, goal, options), options.margin)
            found += 1
        except NoStancesError as error:
            if error.cause == "reach":
                reached = target in reached_by_all(robot, scene, start, options, limb, rng)
                missed, agreed = missed + reached, agreed + (not reached)
    assert found >= repeats(4)
    assert agreed >= repeats(1)
    assert missed <= max(2, repeats(12) // 12)


def test_limbs_of_a_gait_go_at_once() -> None:
    robot = climber("hexapod")
    scene, start = _field(robot, 12)
    sets = (("limb1", "limb3", "limb5"), ("limb2", "limb4", "limb6"))
    names = [limb.name for limb in robot.limbs]
    assert set(sets[0] + sets[1]) == set(names)
    goal = BodyPlace(robot.body_pose(start.q).translation + [0.4 * size_of(robot), 0.0, 0.0])
    path = find_stances(robot, scene, start, goal, StanceOptions(gait=sets))
    check(robot, scene, path)
    changed = [
        sum(a != b for a, b in zip(one.contacts, two.contacts, strict=True)) for one, two in pairwise(path.stances)
    ]
    assert max(changed) == 3


def test_a_route_passes_its_places() -> None:
    robot = climber("anymal_c")
    scene, start = _field(robot, 12)
    at = robot.body_pose(start.q).translation
    corner, end = BodyPlace(at + [0.3, 0.0, 0.0]), BodyPlace(at + [0.3, 0.3, 0.0])
    path = find_stances(robot, scene, start, Route([corner, end]))
    check(robot, scene, path)
    bodies = np.array([robot.body_pose(stance.q).translation for stance in path.stances])
    assert np.linalg.norm(bodies - corner.position, axis=1).min() <= corner.within
    assert np.linalg.norm(bodies[-1] - end.position) <= end.within


def test_a_heading_is_kept() -> None:
    robot = climber("anymal_c")
    scene, start = _field(robot, 12)
    body = robot.body_pose(start.q)
    turned = pin.utils.rotate("z", 0.6) @ body.rotation
    path = find_stances(robot, scene, start, BodyPlace(body.translation, turned, within=0.05))
    check(robot, scene, path)
    assert np.linalg.norm(pin.log3(turned.T @ robot.body_pose(path.stances[-1].q).rotation)) <= 0.05


def test_refusals_say_why_in_numbers() -> None:
    robot = climber("anymal_c")
    scene, start = _field(robot, 6)
    at = robot.body_pose(start.q).translation
    two = tuple(row if limb in (0, 3) else FREE_LIMB for limb, row in enumerate(start.contacts))
    with pytest.raises(NoStancesError, match="LF_FOOT and RH_FOOT") as refused:
        find_stances(robot, scene, Stance(two, start.q), BodyPlace(at))
    assert refused.value.cause == "start"
    high = robot.with_body(start.q, robot.body_pose(start.q) * pin.SE3(np.eye(3), np.array([0.0, 0.0, 0.01])))
    with pytest.raises(NoStancesError, match=r"0\.01 m away"):
        find_stances(robot, scene, Stance(start.contacts, high), BodyPlace(at))
    with pytest.raises(NoStancesError, match=r"reaches .* nearest foothold is .* m away") as refused:
        find_stances(robot, scene, start, BodyPlace(at + [0.0, 0.0, 5.0]), StanceOptions(moves=10))
    assert refused.value.cause == "goal"
    with pytest.raises(NoStancesError, match="proves nothing") as refused:
        find_stances(robot, scene, start, BodyPlace(at + [0.5, 0.0, 0.0]), StanceOptions(moves=1))
    assert refused.value.cause == "limit"
    with pytest.raises(UnknownNameError, match="LF_FOOT"):
        find_stances(robot, scene, start, LimbAt("LF_FOO", scene.footholds[0].id))
    with pytest.raises(RangeError, match=r"start\.contacts"):
        find_stances(robot, scene, Stance((10**6,) * 4, start.q), BodyPlace(at))
    with pytest.raises(ShapeError, match="one for each limb"):
        find_stances(robot, scene, Stance((0, 1), start.q), BodyPlace(at))


def test_a_gap_wider_than_limbs_span_is_refused_before_the_search() -> None:
    robot = climber("anymal_c")
    scene, start = _field(robot, 6)
    wide = 4.0 * size_of(robot)
    width = float(np.ptp(scene.positions[:, 0]))
    far = [
        Foothold(f"far {hold.id}", pin.SE3(np.eye(3), np.array([width + wide, 0.0, 0.0])) * hold.pose)
        for hold in scene.footholds
    ]
    both = ClimbScene([*scene.footholds, *far])
    at = robot.body_pose(start.q).translation + [width + wide, 0.0, 0.0]
    for goal in (BodyPlace(at), LimbAt("LF_FOOT", far[0].id)):
        with pytest.raises(NoStancesError, match=rf"a gap of {wide:.3g} m, .* {len(far)} of {2 * len(far)} foot") as no:
            find_stances(robot, both, start, goal, StanceOptions(moves=1))
        assert no.value.cause == "goal"


def _field(robot: Climber, half: int) -> tuple[ClimbScene, Stance]:
    """A flat field of footholds under a robot at rest."""
    step = size_of(robot) / 8
    z = float(np.mean([robot.contact_pose(robot.rest, limb).translation[2] for limb in range(len(robot.limbs))]))
    holds = [
        Foothold(f"{i},{j}", pin.SE3(np.eye(3), np.array([i * step, j * step, z])))
        for i in range(-half, half + 1)
        for j in range(-half, half + 1)
    ]
    scene = ClimbScene(holds)
    return scene, first_stance(robot, scene, robot.rest)


def test_the_truss_climber_leaves_its_place_on_one_hand() -> None:
    machine = climber("truss_climber")
    course = draw("truss", size_of(machine))
    start = first_stance(machine, course.scene, placed(machine, course.start))
    place = machine.body_pose(placed(machine, course.goal)).translation
    path = find_stances(machine, course.scene, start, BodyPlace(place))
    assert len(path.stances) > 2


@pytest.mark.parametrize("places", [(840, 901), (852, 949), (867, 951)])
def test_a_body_yields_where_limbs_end_at_limits_just_off_their_footholds(places: tuple[int, int]) -> None:
    robot = climber("talos")
    scene = draw("rubble", size_of(robot), 0).scene
    world = ClimbWorld(robot, scene)
    touch, foothold = world.touch[0], world.places[places[0]]
    turn = foothold[:9].reshape(3, 3) @ touch[:9].reshape(3, 3).T
    begun = world.state_of(robot.rest)
    begun[:12] = np.concatenate([turn.ravel(), foothold[9:] - turn @ touch[9:]])
    contacts = np.array(places, dtype=np.int32)
    how, state, _ = world.stand(contacts, contacts, 0.02, begun, followed=False)
    assert how == PostureOutcome.STANDS
    q = world.q_of(state)
    assert beyond_limits(robot.robot, q[None]) is None
    for limb, at in enumerate(places):
        pose, wanted = robot.contact_pose(q, limb), world.places[at]
        np.testing.assert_allclose(pose.translation, wanted[9:], atol=1e-8)
        np.testing.assert_allclose(pose.rotation.ravel(), wanted[:9], atol=1e-8)


@pytest.mark.parametrize(("name", "family"), [("hexapod", "rubble"), ("talos", "rubble"), ("walker", "cylinder")])
def test_links_are_clear_where_all_distances_say_so(name: str, family: str) -> None:
    """Bodies that are far from the robot, and links that never move relative to each other, are not looked at."""
    machine = climber(name)
    scene, robot = draw(family, size_of(machine)).scene, machine.robot
    model, data, rng = robot.model, robot.model.createData(), np.random.default_rng(4)
    links, bodies, apart = climber_bodies(machine), list(scene.bodies.values()), 0.003
    world = ClimbWorld(machine, scene, clear=0.01, apart=apart, spare=0.0)
    table = ShapeTable([body.shape for body in (*links, *bodies)])
    ground = [(body.placement or pin.SE3.Identity()) * pin.SE3(np.eye(3), body.shape.center) for body in bodies]
    beside = [(k, len(links) + j) for k in range(len(links)) for j in range(len(bodies))]
    pairs = {frozenset(pair) for pair in robot.self_pairs or ()}
    own = [(k, j) for k, j in combinations(range(len(links)), 2) if {links[k].link, links[j].link} in pairs]
    first, second = np.array(beside + own).T
    kept = np.repeat([0.01, apart], [len(beside), len(own)])
    free, seen = world.contacts([FREE_LIMB] * len(machine.limbs)), set[bool]()
    for _ in range(60 * repeats(1)):
        at, shaken = rng.choice(scene.positions), world.state_of(machine.rest)
        shaken[9:12] = (
            at + rng.normal(scale=0.3, size=3) + rng.uniform(0.0, 1.2) * size_of(machine) * np.array([0, 0, 1])
        )
        shaken[12:] += rng.normal(scale=rng.choice([0.02, 0.4]), size=len(shaken) - 12)
        pin.framesForwardKinematics(model, data, world.q_of(shaken))
        frames = [data.oMf[model.getFrameId(body.link)] for body in links]
        placed_links = [
            frame * (body.placement or pin.SE3.Identity()) * pin.SE3(np.eye(3), body.shape.center)
            for frame, body in zip(frames, links, strict=True)
        ]
        poses = np.array([place(pose) for pose in (*placed_links, *ground)])
        clear = bool((distances(table, poses, first, second)[:, 0] >= kept).all())
        assert (world.look(free, shaken)[0][1] >= 0.0) == clear
        seen.add(clear)
    assert seen == {True, False}
