"""A climber that obeys a page: rates while they are renewed, a foothold, a stop, and lifts that wait for a yes."""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np
import pytest

from tests.repeats import ALL, MORE
from wbc.climb.climber import Climber
from wbc.climb.report.surroundings import stud_triangles
from wbc.climb.request import ClimberRequest, SceneRequest
from wbc.climb.scene import ClimbScene
from wbc.climb.stance import FREE_LIMB, Stance
from wbc.errors import WbcError
from wbc.viewer.bodies import DrawnMesh
from wbc.viewer.climbing import WalkOperation, standing
from wbc.viewer.messages import RATE_LASTS
from wbc.viewer.scenery import Scenery
from wbc.viewer.walks import scenery_of

Stood = tuple[Climber, ClimbScene, Stance]
#: Robots and scenes: round a cylinder without weight, over stones with it
PLACES = [("walker", "cylinder_grid", "13,9"), ("hexapod", "stepping_stones", "")]


#: What asks nothing of feet and of ground that is stood on is tried with one of them, and with ``REPEATS=3`` with both
ANYWHERE = pytest.mark.parametrize(
    "stood", PLACES if MORE >= ALL else PLACES[:1], ids=lambda place: place[0], indirect=True
)


@pytest.fixture(scope="module", params=PLACES, ids=[robot for robot, *_ in PLACES])
def stood(request: pytest.FixtureRequest) -> Stood:
    robot, scene, place = request.param
    return standing(ClimberRequest(robot), SceneRequest(scene=scene), place)


class Operated:
    """An operation on a clock of its own, on which plans take no time."""

    def __init__(self, stood: Stood) -> None:
        self.now = 0.0
        self.operation = WalkOperation(*stood, backend="vm", now=lambda: self.now)
        self.loop, self.climber = self.operation.loop, self.operation.climber

    def obey(self, kind: str, **fields: object) -> None:
        self.operation.obey({"type": kind, **fields})

    def ticks(self, count: int, until: Callable[[], bool] = lambda: False) -> None:
        for _ in range(count):
            while self.operation.planning:
                time.sleep(0.002)
            self.operation.tick()
            self.now += self.loop.dt
            if until():
                return

    def steered(self, rates: list[float], count: int, kind: str = "steer", until: Callable[[], bool] = bool) -> None:
        """Rates that are renewed for some ticks."""
        for _ in range(count // 10):
            self.obey(kind, rates=rates)
            self.ticks(10, until)
            if until():
                return

    @property
    def body(self) -> np.ndarray:
        return np.array(self.loop.stance.q[:3])

    @property
    def note(self) -> dict[str, object]:
        return self.operation.note

    def tip(self, limb: int) -> np.ndarray:
        return np.array(self.climber.contact_pose(self.loop.stance.q, limb).translation)

    def surface(self) -> np.ndarray:
        """Axes of the surface under the body: ahead, left, outwards."""
        return self.operation.steering.under(self.climber.body_pose(self.loop.stance.q)).rotation


@pytest.fixture
def operated(stood: Stood) -> Operated:
    return Operated(stood)


def test_a_body_goes_while_it_is_steered_and_stops_when_nobody_says_so(operated: Operated) -> None:
    loop, begin, axes, full = operated.loop, operated.body, operated.surface(), operated.operation.speed
    operated.steered([0.0, 1.0, 0.0], 300)
    ahead, left, outwards = axes.T @ (operated.body - begin)
    assert 0.5 * full[0] < ahead / 3.0 < 1.05 * full[0]
    assert max(abs(left), abs(outwards)) < 0.2 * ahead
    operated.ticks(round(RATE_LASTS / loop.dt) + 300)
    assert np.abs(loop.velocity).max() < 1e-3
    assert FREE_LIMB not in loop.stance.contacts
    # A stop while it goes, within the accelerations of its joints, and what a stopped robot does not obey
    operated.steered([1.0, 0.0, 0.0], 60)
    operated.obey("stop")
    limit = operated.climber.robot.limits.acceleration[6:] * loop.dt
    for _ in range(60):
        before = loop.velocity[6:]
        operated.ticks(1)
        assert (np.abs(loop.velocity[6:] - before) <= limit * (1 + 1e-6)).all()
    assert np.abs(loop.velocity).max() < 1e-3
    with pytest.raises(WbcError, match="resume"):
        operated.obey("steer", rates=[1.0, 0.0, 0.0])
    assert loop.stopped
    operated.obey("resume")
    assert not loop.stopped
    assert not operated.operation.stopped
    begin = operated.body
    operated.steered([0.0, 1.0, 0.0], 400)
    assert np.linalg.norm(operated.body - begin) > 0.3 * full[0]


def test_a_foothold_that_was_clicked_is_gone_to(operated: Operated, stood: Stood) -> None:
    climber, scene, stance = stood
    scenery = scenery_of(climber, scene, stance.q, np.array(stance.contacts))
    colours = {scenery.dress[link][1] for link in scenery.dress}
    assert len(colours) == 2 * len(climber.limbs)
    assert len(scenery.studs.triangles) == len(stud_triangles(scene, range(len(scene.footholds)), 1.0))
    away = np.linalg.norm(scene.positions - operated.body, axis=1)
    row = int(np.abs(away - 1.05 * np.sort(away)[4]).argmin())
    # A ray from outside through the stud is a click
    normal, place = scene.normals[row], scene.positions[row]
    assert scenery.hit(place + 0.5 * scenery.near * normal, -normal) == scene.footholds[row].id
    assert scenery.hit(place + 2.0 * scenery.near * normal, normal) is None
    operated.obey("go", hold=scene.footholds[row].id)
    operated.ticks(6000, lambda: operated.loop.still)
    operated.ticks(6000, lambda: bool(np.abs(operated.loop.velocity).max() < 1e-4))
    off = operated.body - place
    assert np.linalg.norm(off - (off @ normal) * normal) < 0.05 * np.linalg.norm(off) + 0.02
    assert not operated.note["reason"]


@ANYWHERE
def test_lifts_wait_for_a_yes_or_another_foothold(operated: Operated) -> None:
    operation, loop = operated.operation, operated.loop
    operated.obey("ask", on=True)
    forward = [0.0, 1.0, 0.0]
    operated.steered(forward, 3000, until=lambda: bool(operation.waiting))
    held, (name, target) = loop.stance.contacts, operation.waiting.split(": ")
    assert operated.note["waiting"] == operation.waiting
    assert target.split(" -> ")[1] in operated.note["reserved"]
    operated.steered(forward, 200)
    assert loop.stance.contacts == held
    # Where a foothold cannot be had the page is told so, and the lift goes on waiting
    other = loop.scene.footholds[next(row for k, row in enumerate(held) if operated.climber.limbs[k].name != name)].id
    operated.obey("go", hold=other)
    operated.steered(forward, 200)
    assert "it is for" in str(operated.note["reason"])
    assert operation.waiting.startswith(name)
    operated.obey("approve")
    operated.steered(forward, 2000, until=lambda: loop.stance.contacts != held)
    limb = operated.climber.row(name)
    assert [k for k, row in enumerate(loop.stance.contacts) if row != held[k]] == [limb]
    operated.obey("ask", on=False)
    assert loop.approve is None


@ANYWHERE
def test_one_limb_is_moved_alone_and_closes_on_a_foothold(operated: Operated) -> None:
    loop, limb = operated.loop, 1
    name, body, foothold = operated.climber.limbs[1].name, operated.body, loop.scene.footholds[loop.held[1]].id
    with pytest.raises(WbcError, match="choose one"):
        operated.obey("hand", rates=[0.0, 0.0, 1.0, 0.0])
    operated.obey("arm", name=name)
    begin = operated.tip(limb)
    operated.steered([0.0, 0.0, 1.0, 0.0], 200, "hand")
    operated.ticks(100)
    # Nobody renewed it: the limb came to rest off the surface, and the body stood
    assert np.abs(loop.velocity).max() < 1e-3
    assert 0.003 < np.linalg.norm(operated.tip(limb) - begin) < 0.4
    assert loop.stance.contacts[limb] == FREE_LIMB
    assert np.abs(operated.body - body).max() < 0.002
    assert operated.note["arm"] == name
    with pytest.raises(WbcError, match="the body stands"):
        operated.obey("steer", rates=[0.0, 1.0, 0.0])
    # A foothold that another limb holds is refused in words, and the limb stays
    here = operated.tip(limb)
    operated.obey("go", hold=loop.scene.footholds[loop.held[0]].id)
    operated.ticks(60)
    assert "it is for" in str(operated.note["reason"])
    assert np.linalg.norm(operated.tip(limb) - here) < 1e-3
    operated.obey("go", hold=foothold)
    operated.ticks(1500, lambda: foothold in operated.note["held"])  # type: ignore[operator]
    assert loop.scene.footholds[loop.stance.contacts[limb]].id == foothold
    # One that is let go in the air comes down
    operated.steered([0.0, 0.0, 1.0, 0.0], 100, "hand")
    assert loop.stance.contacts[limb] == FREE_LIMB
    operated.obey("arm", name="")
    operated.ticks(1500, lambda: FREE_LIMB not in loop.stance.contacts)
    assert FREE_LIMB not in loop.stance.contacts
    assert operated.note["arm"] == ""


@ANYWHERE
def test_rates_last_until_there_is_a_plan_for_them_and_then_as_long_as_ever(operated: Operated) -> None:
    begin, loop, operation = operated.body, operated.loop, operated.operation
    with operation._aside.lock:
        while not operation.planning:
            operated.obey("steer", rates=[0.0, 1.0, 0.0])
            operation.tick()
            operated.now += loop.dt
        for _ in range(20):
            operated.now += RATE_LASTS
            operation.tick()
    operated.ticks(round(RATE_LASTS / loop.dt))
    assert np.linalg.norm(operated.body - begin) > 0.05 * RATE_LASTS * operation.speed[0]
    operated.ticks(500)
    assert np.abs(loop.velocity).max() < 1e-3


def test_a_limb_whose_elbow_is_folded_leaves_its_foothold_away_from_the_body() -> None:
    operated = Operated(standing(ClimberRequest("walker"), SceneRequest(scene="cylinder_grid")))
    operated.steered([0.0, 1.0, 0.0], 530)
    operated.ticks(800)
    held, begin = operated.loop.stance.contacts, operated.tip(0)
    assert FREE_LIMB not in held
    operated.obey("arm", name=operated.climber.limbs[0].name)
    operated.steered([0.0, 0.0, 1.0, 0.0], 150, "hand")
    assert not operated.note["reason"]
    assert operated.loop.stance.contacts == (FREE_LIMB, *held[1:])
    assert np.linalg.norm(operated.tip(0) - begin) > 0.05


@ANYWHERE
@pytest.mark.parametrize("kind", ["hand", "go"])
def test_limbs_in_the_air_land_before_another_one_is_moved_alone(operated: Operated, kind: str) -> None:
    loop = operated.loop
    operated.steered([0.0, 1.0, 0.0], 3000, until=lambda: FREE_LIMB in loop.held)
    operated.ticks(20)
    limb = next(k for k, held in enumerate(loop.held) if held != FREE_LIMB)
    begin, foothold = operated.tip(limb), loop.plan.scene.footholds[loop.held[limb]].id
    operated.obey("arm", name=operated.climber.limbs[limb].name)
    operated.ticks(1)

    def moved() -> bool:
        return bool(np.linalg.norm(operated.tip(limb) - begin) > 0.002)

    if kind == "go":
        # Where it is already: the others land, and nothing is refused
        operated.obey("go", hold=foothold)
        operated.ticks(1500, until=lambda: FREE_LIMB not in loop.held)
    else:
        operated.steered([0.0, 0.0, 1.0, 0.0], 1500, "hand", moved)
        assert moved(), operated.note
    assert FREE_LIMB not in loop.held[:limb] + loop.held[limb + 1 :]


def test_a_page_is_told_which_footholds_are_reserved_and_gone_and_how_a_limb_goes(operated: Operated) -> None:
    loop = operated.loop
    operated.steered([0.0, 1.0, 0.0], 2000, until=lambda: FREE_LIMB in loop.stance.contacts)
    move, said = loop.coming[0], operated.note
    foothold = loop.plan.scene.footholds[move.lands]
    assert foothold.id in said["reserved"]  # type: ignore[operator]
    assert not said["gone"]
    # The way ends where the foothold is
    end = np.array(said["ways"][0][-1])  # type: ignore[index]
    assert np.linalg.norm(end - foothold.pose.translation) < 0.01
    operated.ticks(1)
    assert operated.note is said
    taken = {*loop.held, *(coming.lands for coming in loop.coming)}
    free = next(hold.id for row, hold in enumerate(loop.scene.footholds) if row not in taken)
    loop.see(loop.scene.without(free))
    operated.ticks(1)
    assert operated.note["gone"] == [free]


@ANYWHERE
@pytest.mark.parametrize(
    ("message", "said"),
    [
        ({"type": "steer", "rates": [1, 2]}, "steer.rates"),
        ({"type": "steer", "rates": [0, 0, float("nan")]}, "steer.rates"),
        ({"type": "steer", "rates": [0, 9, 0]}, "full speed"),
        ({"type": "steer", "rates": "fast"}, "steer.rates"),
        ({"type": "go", "hold": "nowhere"}, "go.hold"),
        ({"type": "go", "hold": 3}, "go.hold"),
        ({"type": "ask", "on": "yes"}, "ask.on"),
        ({"type": "arm", "name": "arm9"}, "arm.name"),
        ({"type": "hand", "rates": [0, 0, 2, 0]}, "full speed"),
        ({"type": "hand", "rates": [0, 0, 1]}, "hand.rates"),
        ({"type": "set", "item": "body", "values": {}}, "steer"),
    ],
)
def test_what_does_not_fit_is_refused(stood: Stood, message: dict[str, object], said: str) -> None:
    operated = Operated(stood)
    plan = operated.loop.plan
    for act in (operated.operation.check, operated.operation.obey):
        with pytest.raises(WbcError, match=said):
            act(message)
    operated.ticks(1)
    assert operated.loop.plan is plan


def test_a_click_beside_all_footholds_is_none() -> None:
    empty, places = (
        DrawnMesh(np.zeros((0, 3)), np.zeros((0, 3), dtype=np.uint32), (0, 0, 0)),
        np.array([[0.0] * 3, [1.0, 0, 0]]),
    )
    scenery = Scenery((), empty, ("a", "b"), places, (0.0, 0.0, 1.0), "body", (), {}, 0.25)
    assert scenery.hit(np.array([0.5, 0.0, 1.0]), np.array([0.0, 0.0, -1.0])) is None
    assert scenery.hit(np.array([0.9, 0.0, 1.0]), np.array([0.0, 0.0, -3.0])) == "b"
