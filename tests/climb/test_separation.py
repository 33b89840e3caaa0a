"""What keeps a climber from its goal is said: the step that lacks least, and by how much."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest
from scipy.optimize import linprog

from tests.climb.by_hand import climber
from tests.repeats import ALL, MORE
from wbc.climb import BodyPlace, ClimbScene, first_stance, plan_climb
from wbc.climb.contacts import FlatFoot, GripHand, PointFoot, SuctionPad
from wbc.climb.planning import ClimbOptions
from wbc.climb.scene import Foothold, SceneBody, size_of
from wbc.climb.scenes import placed
from wbc.climb.search import NoStancesError, StanceOptions
from wbc.climb.surfaces import FootholdRules, footholds_on, frame_on
from wbc.shapes import Box


def floors(size: float, wide: float) -> ClimbScene:
    """Two floors with a gap between them."""
    bodies, footholds = dict[str, SceneBody](), list[Foothold]()
    for name, begin, end in (("near", -size, 0.5 * size), ("far", 0.5 * size + wide, 2.0 * size + wide)):
        at = np.array([(begin + end) / 2, 0.0, -0.25 * size])
        body = bodies[name] = SceneBody(Box((end - begin, size, 0.5 * size)), pin.SE3(np.eye(3), at))
        footholds += footholds_on(
            name, body.shape, body.placement, FootholdRules(0.25 * size, 0.05 * size, max_slope=0.1)
        )
    return ClimbScene(footholds, bodies)


def test_the_step_that_was_not_found_over_a_gap_is_named() -> None:
    robot = climber("talos")
    size = size_of(robot)
    scene = floors(size, 0.9 * size)
    start = first_stance(robot, scene, placed(robot, frame_on([-0.3 * size, 0.0, 0.0], [0.0, 0.0, 1.0])))
    goal = robot.body_pose(start.q).translation + [2.2 * size, 0.0, 0.0]
    with pytest.raises(
        NoStancesError, match=r"the step from near \d+ to far \d+, .* m away .* (reach|lacks)"
    ) as refused:
        plan_climb(
            robot, scene, start, BodyPlace(goal), ClimbOptions(StanceOptions(moves=400 if MORE < ALL else 20000))
        )
    # What was tried of a gap is no proof: the search has gone on to its own limit
    assert refused.value.cause == "limit"


def test_a_step_on_which_neither_foot_bears_the_robot_is_none() -> None:
    robot = climber("talos")
    size = size_of(robot)
    scene = floors(size, 0.7 * size)
    start = first_stance(robot, scene, placed(robot, frame_on([-0.3 * size, 0.0, 0.0], [0.0, 0.0, 1.0])))
    goal = BodyPlace(robot.body_pose(start.q).translation + [2.2 * size, 0.0, 0.0])
    # Feet on both sides can hold, with the weight between them
    with pytest.raises(NoStancesError, match=r"none of the 60 shortest steps .* with the weight on"):
        plan_climb(robot, scene, start, goal, ClimbOptions(StanceOptions(moves=400)))


@pytest.mark.parametrize(
    ("kind", "other"),
    [
        (PointFoot(0.6), PointFoot(0.4)),
        (FlatFoot((0.1, 0.05), 0.6), FlatFoot((0.08, 0.04), 0.4)),
        (SuctionPad(100.0, 0.05, 0.6), SuctionPad(100.0, 0.04, 0.4)),
        (GripHand(), GripHand()),
    ],
)
def test_a_share_counts_of_friction_and_of_soles(kind: object, other: object) -> None:
    lower = kind.lower(0.5, 0.8)  # type: ignore[attr-defined]
    assert all(np.allclose(a, b) for a, b in zip(lower.cone(), other.cone(), strict=True))  # type: ignore[attr-defined]
    assert kind.lower(np.inf) == kind  # type: ignore[attr-defined]


def test_a_flat_foot_bears_what_its_corners_bear() -> None:
    """Referee: a linear program over forces at the corners, their friction within squares inside of its circle."""
    foot, corner, drawn = FlatFoot((0.1, 0.05), 0.6), 0.6 / np.sqrt(2.0), np.random.default_rng(1)
    slopes, bounds = foot.cone()
    places = [np.array([x, y, 0.0]) for x in (-0.1, 0.1) for y in (-0.05, 0.05)]
    wrenches = np.hstack([np.vstack([np.eye(3), pin.skew(place)]) for place in places])
    squares = np.kron(np.eye(4), [[1.0, 0, -corner], [-1.0, 0, -corner], [0, 1.0, -corner], [0, -1.0, -corner]])
    pressed = [(None, None), (None, None), (0.0, None)] * 4
    borne = list[bool]()
    for _ in range(200):
        # Pressed with 1 N anywhere in the sole, pushed along and turned
        force = [*drawn.uniform(-0.9 * corner, 0.9 * corner, 2), 1.0]
        arm = [*drawn.uniform(-1.0, 1.0, 2) * foot.half_lengths, 0.0]
        wrench = np.concatenate([force, np.cross(arm, force)])
        wrench[5] = drawn.uniform(-1.0, 1.0) * 0.3 * sum(foot.half_lengths)
        answer = linprog(np.zeros(12), squares, np.zeros(len(squares)), wrenches, wrench, pressed)
        # Rows of Coulomb's circle are of the whole force; those of moments are what the corners say
        turned = (slopes @ wrench <= bounds + 1e-12)[9:]
        assert bool(turned.all()) == (answer.status == 0 and abs(wrench[5]) <= 0.3 * sum(foot.half_lengths))
        borne.append(bool(turned.all()))
    assert 50 < sum(borne) < 150
    # At a corner there is nothing to turn about
    at_corner = np.array([0.0, 0.0, 1.0, 0.05, -0.1, 0.005])
    assert (slopes @ at_corner > bounds + 1e-6).any()
