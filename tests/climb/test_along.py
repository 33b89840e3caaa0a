"""Bodies that go their way while limbs change footholds, or that are driven; limbs that work; climbs that go on."""

from __future__ import annotations

import dataclasses
import subprocess
import sys
import textwrap

import numpy as np
import pinocchio as pin
import pytest

from tests.climb.arriving import arrives
from tests.climb.walkers import over
from wbc.climb import BodyPlace, ClimbScene, ContactPlan, Stance, first_stance, machines, plan_climb
from wbc.climb.along import AlongOptions, BodyTrack, plan_along, planning
from wbc.climb.balance import Equilibrium
from wbc.climb.clear import Clearances
from wbc.climb.climber import Climber
from wbc.climb.drive import ClimbDrive, standing_plan
from wbc.climb.grids import INCH, cylinder_grid, remove_rows
from wbc.climb.limb_work import moved_by, plan_limb_work
from wbc.climb.loop import Cause, ClimbLoop, ClimbOutcome, ClimbRun, LimbState
from wbc.climb.loop.reference import PlanReference
from wbc.climb.resume import stance_in
from wbc.climb.scene import size_of
from wbc.climb.scenes import draw, placed
from wbc.climb.search import NoStancesError
from wbc.climb.stance import FREE_LIMB
from wbc.errors import InfeasibleError, RangeError, ShapeError, UnknownNameError


@pytest.fixture(scope="module")
def plan(walker: Climber, scene: ClimbScene) -> ContactPlan:
    return plan_along(walker, scene, BodyTrack((over(13, 8), over(13, 12)), 4 * INCH))


@pytest.fixture(scope="module")
def run(plan: ContactPlan) -> ClimbRun:
    return ClimbLoop(plan, backend="vm").run()


def test_the_body_goes_on_while_limbs_change_footholds(plan: ContactPlan, run: ClimbRun, walker: Climber,
                                                       scene: ClimbScene) -> None:  # fmt: skip
    arrives(run, walker, scene)
    assert plan.moves
    t, q = run.log["t"], run.log.array("q")
    speed = np.linalg.norm(np.diff(q[:, :3], axis=0), axis=1) / np.diff(t)
    between = speed[(t[1:] > 0.5) & (t[1:] < t[-1] - 0.5)]
    assert between.mean() >= 0.98 * 4 * INCH
    assert between.min() > 0.5 * 4 * INCH
    assert speed.max() <= 1.01 * 4 * INCH
    # On its straight way, with its turn
    along = q[:, :3] - over(13, 8).translation
    way = over(13, 12).translation - over(13, 8).translation
    way /= np.linalg.norm(way)
    assert np.linalg.norm(along - (along @ way)[:, None] * way, axis=1).max() < 1e-3


@pytest.mark.parametrize(("begin", "end"), [((6, 18), (14.37, 6)), ((19, 12), (6, 12))])
def test_long_ways_at_full_speed_take_little_searching(walker: Climber, scene: ClimbScene, begin: tuple[float, float],
                                                       end: tuple[float, float]) -> None:  # fmt: skip
    middle = 0.5 * (begin[0] + end[0]), 0.5 * (begin[1] + end[1])
    track = BodyTrack((over(*begin), over(*middle), over(*end)), 6 * INCH)
    plan = plan_along(walker, scene, track, options=AlongOptions(moves=500))
    assert plan.times[-1] < 1.03 * track.duration
    arrives(ClimbLoop(plan, backend="vm").run(most=2.0 * float(plan.times[-1])), walker, scene)


def test_footholds_count_while_a_limb_comes_holds_and_leaves(plan: ContactPlan, walker: Climber,
                                                             scene: ClimbScene) -> None:  # fmt: skip
    clearances, last = Clearances(walker, scene), float(plan.times[-1])
    contacts, within = [[row] for row in plan.start], [[(0.0, last)] for _ in plan.start]
    for move in plan.moves:
        limb = within[move.limb]
        limb[-1] = limb[-1][0], move.land
        limb.append((move.lift, last))
        contacts[move.limb].append(move.lands)
    assert clearances.moving(contacts, plan.times, plan.q, plan.v, within) is None
    move = plan.moves[0]
    within[move.limb][1] = move.land + 0.2, last
    near = clearances.moving(contacts, plan.times, plan.q, plan.v, within)
    assert near is not None
    assert move.lift < near.time < move.land + 0.3
    assert walker.limbs[move.limb].name in near.first + near.second


def test_a_round_way_on_a_cylinder_keeps_its_distance(walker: Climber, scene: ClimbScene) -> None:
    track = BodyTrack((over(11, 12), over(13, 12)), 4 * INCH)
    axis_distance = [np.linalg.norm(pose.translation[:2]) for pose in track.sampled]
    np.testing.assert_allclose(axis_distance, 152 * INCH, atol=1e-9)
    np.testing.assert_allclose(track.sampled[-1].homogeneous, over(13, 12).homogeneous, atol=1e-9)
    # Twists are those of the poses, by differences of Pinocchio's own
    h = track.instants[1]
    for k in (5, 20):
        step = pin.log6(track.sampled[k - 1].actInv(track.sampled[k + 1])).vector / (2.0 * h)
        np.testing.assert_allclose(track.twists[k], step, atol=1e-6)
    turned = plan_along(walker, scene, track)
    arrives(ClimbLoop(turned, backend="vm").run(), walker, scene)


@pytest.mark.parametrize(("name", "family"), [("hexapod", "stepping_stones"), ("three_pandas", "cylinder")])
def test_other_limbs_go_along_a_way(name: str, family: str) -> None:
    climber = machines.climber(name)
    size = size_of(climber)
    course = draw(family, size)
    start = first_stance(climber, course.scene, placed(climber, course.start))
    begin, end = (climber.body_pose(q) for q in (start.q, placed(climber, course.goal)))
    ahead = end.translation - begin.translation
    ahead *= 0.8 * size / np.linalg.norm(ahead)
    track = BodyTrack((begin, pin.SE3(begin.rotation, begin.translation + ahead)), 0.05 * size)
    plan = plan_along(climber, course.scene, track, start)
    assert plan.moves
    arrives(ClimbLoop(plan, backend="vm").run(), climber, course.scene)


def test_ways_without_footholds_are_refused(walker: Climber) -> None:
    less = remove_rows(cylinder_grid(), "10-20")
    with pytest.raises(NoStancesError, match=r"all limbs can hold to \d+ % of it"):
        plan_along(walker, less, BodyTrack((over(13, 8), over(13, 12)), 6 * INCH))
    for poses, speed, error in (
        ((over(13, 8),), 0.1, ShapeError), ((over(13, 8), over(13, 9)), 0.0, RangeError),
        ((over(13, 8), over(13, 8)), 0.1, RangeError), ((over(13, 8), over(13, 9)), 1e-5, RangeError),
    ):  # fmt: skip
        with pytest.raises(error):
            BodyTrack(poses, speed)


def test_a_search_that_lacks_memory_says_so() -> None:
    """In a process of its own, of whose memory all is taken but a little; it used to end there."""
    source = """
        import ctypes, resource
        from pathlib import Path
        from tests.climb.test_along import BodyTrack, cylinder_grid, machines, over, plan_along
        walker, scene = machines.climber("walker"), cylinder_grid()
        plan_along(walker, scene, BodyTrack((over(13, 8), over(13, 9)), 0.1))
        track = BodyTrack((over(13, 2), over(13, 23)), 0.01)
        track.places, track.twists
        libc, taken, count = ctypes.CDLL(None), [0] * 100_000, 0
        libc.malloc.restype, libc.free.argtypes = ctypes.c_void_p, [ctypes.c_void_p]
        resource.setrlimit(resource.RLIMIT_AS, (4096 * int(Path("/proc/self/statm").read_text().split()[0]), -1))
        while block := libc.malloc(2**16):
            taken[count], count = block, count + 1
        for _ in range(8):
            for block in taken[count - 8 : count]:
                libc.free(block)
            count -= 8
            try:
                plan_along(walker, scene, track)
                break
            except MemoryError as error:
                print("lacks memory for", error)
    """
    done = subprocess.run([sys.executable, "-c", textwrap.dedent(source)], capture_output=True, text=True, check=True)
    assert "lacks memory for a search along a way" in done.stdout


def test_a_start_that_is_not_on_the_way_is_refused(plan: ContactPlan, walker: Climber, scene: ClimbScene) -> None:
    with pytest.raises(RangeError, match="off the beginning"):
        plan_along(walker, scene, BodyTrack((over(13, 9), over(13, 12)), 0.1), Stance(plan.start, plan.q[0]))


def test_a_climb_goes_on_from_its_log(run: ClimbRun, walker: Climber, scene: ClimbScene) -> None:
    # While a limb is in the air, and while all hold
    aloft = next(time for time, _, state, _ in run.changes if state is LimbState.SWINGING) + 0.9
    for at in (aloft, None):
        stance = stance_in(run.log, walker, scene, at)
        assert (min(stance.contacts) < 0) == (at is aloft)
        ahead = walker.body_pose(stance.q).translation + [0.0, 0.0, -0.1]
        arrives(ClimbLoop(plan_climb(walker, scene, stance, BodyPlace(ahead)), backend="vm").run(), walker, scene)
    # A limb that had come to its foothold and was not closed yet holds it
    contacts, t = run.log.array("contact"), run.log["t"]
    row, limb = (int(k[0]) for k in np.nonzero((contacts[1:] >= 0) & (contacts[:-1] < 0)))
    assert stance_in(run.log, walker, scene, float(t[row])).contacts[limb] == contacts[row + 1, limb]
    with pytest.raises(RangeError, match="expected a value in"):
        stance_in(run.log, walker, scene, 1e3)
    with pytest.raises(ShapeError, match="its scene is another"):
        stance_in(run.log, walker, scene.without("1,1"))


def test_a_driven_body_takes_up_other_rates(plan: ContactPlan, walker: Climber, scene: ClimbScene) -> None:
    drive, start = ClimbDrive(walker), Stance(plan.start, plan.q[0])
    loop = ClimbLoop(standing_plan(walker, scene, start), replan=drive.following, onward=drive.onward, backend="vm")
    places = [walker.body_pose(loop.stance.q).translation]
    for twist in ([0.08, 0.0, 0.0, 0.0, 0.0, 0.0], [-0.06, 0.0, 0.0, 0.0, 0.0, 0.02]):
        until = loop.time + 2.0
        while loop.time < until:
            drive.steer(twist, loop)
            loop.tick()
        places.append(walker.body_pose(loop.stance.q).translation)
    while not loop.ended:
        drive.finish(loop)
        loop.tick()
    arrives(loop.result(), walker, scene)
    moved = np.diff([place[2] for place in places])
    assert moved[0] < -0.08
    assert moved[1] > -0.02


def test_a_limb_works_while_the_others_hold(plan: ContactPlan, walker: Climber, scene: ClimbScene) -> None:
    start = Stance(plan.start, plan.q[0])
    row = walker.row("arm3")
    pose = walker.contact_pose(start.q, row)
    up = pin.SE3(pose.rotation, pose.translation + 0.1 * pose.rotation[:, 2])
    back = scene.footholds[start.contacts[row]].id
    work = plan_limb_work(
        walker, scene, start, "arm3", [up, *moved_by(up, [0.04, 0.0, 0.04, 0.0, 0.0, 0.0], 1.0), back]
    )
    run = ClimbLoop(work, backend="vm").run()
    arrives(run, walker, scene)
    assert [move.lands for move in work.moves][-1] == start.contacts[row]
    q = run.log.array("q")
    body = np.linalg.norm(q[:, :3] - q[0, :3], axis=1)
    assert body.max() < 1e-3
    highest = max(
        float((walker.contact_pose(at, row).translation - pose.translation) @ pose.rotation[:, 2]) for at in q[::5]
    )
    assert highest > 0.09
    with pytest.raises(UnknownNameError):
        plan_limb_work(walker, scene, start, "arm4", [up])
    with pytest.raises(InfeasibleError, match="out of reach"):
        plan_limb_work(walker, scene, start, "arm3", ["1,1"])
    with pytest.raises(RangeError, match="it is for arm1"):
        plan_limb_work(walker, scene, start, "arm3", [scene.footholds[start.contacts[0]].id])


def test_a_limb_that_fails_is_lifted_and_the_others_go_on() -> None:
    from wbc.climb.request import ClimberRequest, ClimbRequest, PathRequest, PlantRequest, SceneRequest
    from wbc.climb.session import climb

    request = ClimbRequest(
        PathRequest(points=("0,8",)), ClimberRequest("hexapod_grips"), SceneRequest(scene="cylinder"),
        PlantRequest(fail=("limb1 at 1",)),
    )  # fmt: skip
    done = climb(request, backend="vm")
    assert done.run.outcome is ClimbOutcome.ARRIVED, done.run.reason
    assert done.report is not None
    assert done.report.clean, str(done.report)
    failed = [(limb, state) for _, limb, state, cause in done.run.changes if cause is Cause.LIMB_FAILED]
    column = done.run.log["contact.limb1"]
    assert failed in ([("limb1", LimbState.FREE)], [])
    assert (column[done.run.log["t"] > 1.05] == -1).all()
    assert len(done.run.plans) == 2


def test_footholds_of_able_limbs(scene: ClimbScene) -> None:
    first, *rest = scene.footholds[:4]
    some = dataclasses.replace(scene, footholds=[dataclasses.replace(first, limbs=("arm1",)), *rest])
    able = some.held_by(["arm2", "arm3"])
    assert [foothold.id for foothold in able.footholds] == [foothold.id for foothold in rest]
    assert {foothold.limbs for foothold in able.footholds} == {("arm2", "arm3")}


def test_a_way_on_which_a_limb_has_to_let_go_at_once_is_none(walker: Climber, scene: ClimbScene) -> None:
    start = first_stance(walker, scene, walker.with_body(walker.rest, over(13, 12)))
    begin = walker.body_pose(start.q)
    # Within the first instant the body is farther off than any limb is long
    away = BodyTrack((begin, begin * pin.SE3(np.eye(3), np.array([0.0, 0.0, 40.0]))), 400.0)
    with pytest.raises(NoStancesError, match=r"has to let go of .* as it begins"):
        plan_along(walker, scene, away, start)
    off = dataclasses.replace(start, q=walker.with_limb(start.q, 0, walker.angles(start.q, 0) + 0.01))
    with pytest.raises(RangeError, match="is not at this foothold"):
        plan_along(walker, scene, BodyTrack((begin, over(13, 13)), 4 * INCH), off)


def test_a_way_on_which_joints_would_have_to_stop_is_none(walker: Climber, scene: ClimbScene,
                                                          monkeypatch: pytest.MonkeyPatch) -> None:  # fmt: skip
    def stops(x: np.ndarray, *_: object) -> np.ndarray:
        return np.where(np.abs(np.arange(len(x)) - len(x) // 2) < 2, 0.0, 1.0)

    monkeypatch.setattr(planning, "fastest", stops)
    with pytest.raises(NoStancesError, match="have to stop"):
        plan_along(walker, scene, BodyTrack((over(13, 12), over(13, 12.5)), 4 * INCH))


def test_a_limb_in_the_air_weighs_where_it_comes_down() -> None:
    climber = machines.climber("anymal_c")
    course = draw("stairs", size_of(climber), 0)
    start = first_stance(climber, course.scene, placed(climber, course.start))
    begin, way = climber.body_pose(start.q), 0.4 * size_of(climber) * np.array([0.5, np.sqrt(0.75), 0.0])
    track = BodyTrack((begin, pin.SE3(begin.rotation, begin.translation + way)), 0.08 * size_of(climber))
    plan, options = plan_along(climber, course.scene, track, start), AlongOptions()
    bears, motion, contacts = Equilibrium(climber, course.scene), PlanReference(plan, climber.robot), list(plan.start)
    assert plan.moves
    for move in sorted(plan.moves, key=lambda move: move.lift):
        contacts[move.limb] = FREE_LIMB
        assert min(bears.margin(contacts, motion.q(time)) for time in (move.lift, move.land)) > 0.99 * options.margin
        contacts[move.limb] = move.lands
