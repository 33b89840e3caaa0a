"""A walk that obeys a page: rates while they are renewed, a hold, a stop, and lifts that wait for a yes."""

from __future__ import annotations

import numpy as np
import pytest

from wbc.errors import WbcError
from wbc.robots import Walker
from wbc.viewer.bodies import DrawnMesh
from wbc.viewer.climbing import BODY_SPEED, WalkOperation
from wbc.viewer.messages import RATE_LASTS
from wbc.viewer.scenery import Scenery
from wbc.viewer.walks import scenery_of
from wbc.walking import Structure
from wbc.walking.loop.stack import DT, WalkStack
from wbc.walking.loop.state import Tick
from wbc.walking.loop.walk import Walk
from wbc.walking.modes.drive import Drive, standing_plan
from wbc.walking.planner.plan import Plan
from wbc.walking.run.request import DriveRequest


@pytest.fixture(scope="module")
def begin(machine: Walker, structure: Structure) -> Plan:
    return standing_plan(machine, structure, DriveRequest().beginning(machine.arm_data))


Begun = tuple[WalkOperation, list[float]]


@pytest.fixture
def begun(machine: Walker, structure: Structure, stack: WalkStack, begin: Plan) -> Begun:
    now = [0.0]

    def passes(_tick: Tick) -> None:
        now[0] += DT

    walk = Walk(machine, structure, begin, stack=stack)
    return WalkOperation(Drive(walk), lambda: now[0], passes), now


def ticks(operation: WalkOperation, now: list[float], count: int) -> None:
    for _ in range(count):
        operation.tick()


def test_a_body_goes_while_it_is_steered_and_stops_when_nobody_says_so(begun: Begun) -> None:
    operation, now = begun
    walk = operation.drive.walk
    begin = walk.q[:3].copy()
    for _ in range(8):
        operation.obey({"type": "steer", "rates": [0.0, 1.0, 0.0]})
        ticks(operation, now, 10)
    gone = float(operation.drive.steering.axis @ (walk.q[:3] - begin))
    assert 0.01 < gone < 0.8 * BODY_SPEED[1] * 1.2
    ticks(operation, now, round((RATE_LASTS + 0.6) / walk.dt))
    assert not operation.drive.command.any()
    assert walk.pace == 0.0
    # A stop by hand while it goes, within the accelerations of its joints, and what a stopped walk does not obey
    operation.obey({"type": "steer", "rates": [0.0, 1.0, 0.0]})
    ticks(operation, now, 20)
    operation.obey({"type": "stop"})
    limit = walk.walker.robot.limits.acceleration[6:] * walk.dt
    for _ in range(60):
        before = walk.v[6:].copy()
        ticks(operation, now, 1)
        assert (np.abs(walk.v[6:] - before) <= limit * (1 + 1e-6)).all()
    assert np.abs(walk.v).max() < 1e-3
    with pytest.raises(WbcError, match="resume"):
        operation.obey({"type": "steer", "rates": [1.0, 0.0, 0.0]})
    assert walk.aborted
    operation.obey({"type": "resume"})
    assert not walk.aborted
    assert not operation.stopped


def test_a_hold_that_was_clicked_is_gone_to_on_a_straight_course(begun: Begun) -> None:
    operation, _ = begun
    walk = operation.drive.walk
    steering, here = operation.drive.steering, walk.q[:3]
    scenery = scenery_of(walk.walker, walk.structure, walk.q)
    # Every arm in its own colour, with the pieces that join its shapes
    colours = {arm.name: scenery.dress[arm.links[0]][1] for arm in walk.walker.arms}
    assert len(set(colours.values())) == len(walk.walker.arms)
    assert all(len(scenery.dress[arm.links[0]][0]) > 100 for arm in walk.walker.arms)
    hold = min(range(len(scenery.holds)), key=lambda k: abs(float(steering.axis @ (scenery.places[k] - here)) - 0.8))
    # A ray from outside through the stud is a click
    off = scenery.places[hold] - steering.origin
    outward = off - (off @ steering.axis) * steering.axis
    outward /= np.linalg.norm(outward)
    assert scenery.hit(scenery.places[hold] + 2.0 * outward, -outward) == scenery.holds[hold]
    assert scenery.hit(scenery.places[hold] + 2.0 * outward, outward) is None
    operation.obey({"type": "go", "hold": scenery.holds[hold]})
    operation.steer()
    course = operation.drive.command
    assert np.linalg.norm(course) == pytest.approx(BODY_SPEED[0], rel=1e-6)
    assert course[1] > 0.0
    assert course[2] == 0.0
    operation.stop("because")
    operation.steer()
    assert not operation.drive.command.any()


def test_lifts_wait_for_a_yes(begun: Begun) -> None:
    operation, _ = begun
    walk, step = operation.drive.walk, type("Step", (), {"arm": "arm1", "source": "1,2", "target": "1,3"})()
    operation.obey({"type": "ask", "on": True})
    assert walk.approve is not None
    assert not walk.approve(step)
    assert operation.waiting == "arm1: 1,2 -> 1,3"
    operation.obey({"type": "approve"})
    assert not operation.waiting
    assert walk.approve(step)
    assert not walk.approve(step)
    operation.obey({"type": "ask", "on": False})
    assert walk.approve is None


def test_one_hand_is_moved_alone_and_closes_on_a_hold(begun: Begun) -> None:
    operation, now = begun
    walk = operation.drive.walk
    body, hold = walk.q[:3].copy(), walk.structure.ids[walk.held[1]]
    with pytest.raises(WbcError, match="choose one"):
        operation.obey({"type": "hand", "rates": [0.0, 0.0, 1.0, 0.0]})
    operation.obey({"type": "arm", "name": "arm2"})
    first = walk.machine.chain.origins[1].copy()
    operation.obey({"type": "hand", "rates": [0.0, 0.0, 1.0, 0.0]})
    begin = now[0]
    ticks(operation, now, 1)
    # Nobody renewed it: the hand came to rest within its stop, off the structure
    assert now[0] - begin < 2.0
    off = walk.machine.chain.origins[1] - first
    assert 0.003 < np.linalg.norm(off) < 0.1
    assert 1 not in walk.held
    assert np.abs(walk.q[:3] - body).max() < 0.002
    assert np.abs(walk.v).max() < 1e-2
    assert operation.note["arm"] == "arm2"
    with pytest.raises(WbcError, match="the body stands"):
        operation.obey({"type": "steer", "rates": [0.0, 1.0, 0.0]})
    # Where the structure is in the way the page is told so, and the hand stays
    here = walk.machine.chain.origins[1].copy()
    operation.obey({"type": "hand", "rates": [0.0, 0.0, -1.0, 0.0]})
    ticks(operation, now, 1)
    operation.obey({"type": "go", "hold": walk.structure.ids[walk.held[0]]})
    ticks(operation, now, 2)
    assert "another hand" in operation.note["reason"]
    assert np.linalg.norm(walk.machine.chain.origins[1] - here) < 0.05
    operation.obey({"type": "go", "hold": hold})
    ticks(operation, now, 1)
    assert walk.structure.ids[walk.held[1]] == hold
    operation.obey({"type": "arm", "name": ""})
    ticks(operation, now, 5)
    assert operation.note["arm"] == ""
    assert len(walk.held) == 3


def test_a_page_is_told_which_holds_are_reserved_and_gone_and_how_a_hand_goes(begun: Begun) -> None:
    operation, now = begun
    walk = operation.drive.walk
    ticks(operation, now, 1)
    assert not operation.note["gone"]
    for _ in range(80):
        operation.obey({"type": "steer", "rates": [0.0, 1.0, 0.0]})
        ticks(operation, now, 10)
        if walk.swinging is not None:
            break
    ticks(operation, now, 1)
    assert walk.swinging is not None
    target, said = walk.structure.ids[walk.swinging.hold], operation.note
    assert target in said["reserved"]
    # The way ends where the hold is
    end = np.array(said["ways"][0][-1])
    assert np.linalg.norm(end - walk.structure.positions[walk.swinging.hold]) < 0.02
    ticks(operation, now, 1)
    assert operation.note is said
    free = next(name for k, name in enumerate(walk.structure.ids) if k not in walk.held.values() and name != target)
    walk.vanish([free])
    ticks(operation, now, 1)
    assert operation.note["gone"] == [free]


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
def test_what_does_not_fit_is_refused(begun: Begun, message: dict, said: str) -> None:
    operation, _ = begun
    for act in (operation.check, operation.obey):
        with pytest.raises(WbcError, match=said):
            act(message)
    assert not operation.drive.command.any()


def test_a_click_beside_all_holds_is_none() -> None:
    empty = DrawnMesh(np.zeros((0, 3)), np.zeros((0, 3), dtype=np.uint32), (0, 0, 0))
    scenery = Scenery((), empty, ("a", "b"), np.array([[0.0, 0, 0], [1.0, 0, 0]]), (0.0, 0.0, 1.0), "body", (), {})
    assert scenery.hit(np.array([0.5, 0.0, 1.0]), np.array([0.0, 0.0, -1.0])) is None
    assert scenery.hit(np.array([0.9, 0.0, 1.0]), np.array([0.0, 0.0, -3.0])) == "b"
