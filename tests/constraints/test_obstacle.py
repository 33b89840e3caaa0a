"""Obstacle: odd places, the curvature that a tick leaves out, names of rows, what is refused."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

from tests.constraints.robots import robot
from tests.evaluation import probe
from tests.models import placement
from tests.refusals import assert_refused
from wbc.errors import MissingShapeError, RangeError
from wbc.shapes import Capsule, HalfSpace, PlacedShape, Sphere
from wbc.tasks.obstacle import Obstacle


@pytest.mark.parametrize("place", ["center", "end", "beside", "just past the guard"])
def test_no_direction_is_no_number_at_coincident_centres(place: str) -> None:
    """Obstacle centre on the core of a link shape: finite h and a unit direction, so that the robot can leave."""
    bot = robot("panda")
    link, q = "panda_hand", bot.neutral
    rod = PlacedShape(Capsule(0.05, 0.2), pin.SE3(pin.exp3(np.array([1.0, 0.0, 0.0])), np.array([0.0, 0.1, 0.0])))
    ball = PlacedShape(Sphere(0.05), pin.SE3.Identity())
    bot = bot.with_shapes({link: (rod, ball)})
    clear = probe(Obstacle(Sphere(0.1), links=link), bot)
    here = placement(bot, link, q)
    for row, placed in enumerate((rod, ball)):
        offset = {
            "center": placed.placement.translation,
            "end": placed.ends()[1],
            "beside": placed.placement.translation - np.array([0.0, 0.0, 2e-10]),
            "just past the guard": placed.placement.translation + np.array([2e-10, 0.0, 0.0]),
        }[place]
        h, jacobian, _ = clear(q, pose=pin.SE3(np.eye(3), here.act(offset)))
        assert h[row] == pytest.approx(-placed.shape.radius - 0.1, abs=1e-9)
        assert np.isfinite(jacobian).all()
        assert np.linalg.norm(jacobian[row]) > 1e-3


def test_gradient_is_continuous_where_the_nearest_point_reaches_an_end() -> None:
    bot, q = robot("panda"), robot("panda").neutral
    rod = PlacedShape(Capsule(0.05, 0.2), pin.SE3.Identity())
    bot = bot.with_shapes({"panda_hand": (rod,)})
    clear = probe(Obstacle(Sphere(0.1)), bot)
    here = placement(bot, "panda_hand", q)
    rows = [
        clear(q, pose=pin.SE3(np.eye(3), here.act(np.array([0.3, 0.0, 0.1 + step]))))[1] for step in (-1e-9, 0.0, 1e-9)
    ]
    assert rows[0] == pytest.approx(rows[1], abs=1e-8)
    assert rows[2] == pytest.approx(rows[1], abs=1e-8)


def test_labels_and_units() -> None:
    bot = robot("panda").with_shapes(
        {
            "panda_link0": (PlacedShape(Sphere(0.1), pin.SE3.Identity()),),
            "panda_hand": (
                PlacedShape(Sphere(0.1), pin.SE3.Identity()),
                PlacedShape(Capsule(0.1, 0.2), pin.SE3.Identity()),
                PlacedShape(Capsule(0.1, 0.0), pin.SE3.Identity()),
            ),
        }
    )
    labels = [r.label for r in Obstacle(Sphere(0.1)).rows(bot)]
    assert labels == ["panda_hand[0]", "panda_hand[1]", "panda_hand[2]"], "the fixed base cannot keep clear"
    labels = [r.label for r in Obstacle(HalfSpace()).rows(bot)]
    assert labels == ["panda_hand[0]", "panda_hand[1].start", "panda_hand[1].end", "panda_hand[2]"]
    assert {r.unit for r in Obstacle(HalfSpace()).rows(bot)} == {"m"}


def test_links_without_shapes_are_refused() -> None:
    bot = robot("panda")
    bare = next(n for n in bot.frame_names if n.startswith("panda_link") and n not in bot.shapes)
    with pytest.raises(MissingShapeError) as caught:
        Obstacle(Sphere(0.1), links=bare).validate(bot)
    assert set(caught.value.choices) == set(bot.shapes)
    assert_refused(lambda: Obstacle(Sphere(0.1)).validate(bot.with_shapes({})), MissingShapeError, "no moving link")
    fixed = bot.with_shapes({"panda_link0": (PlacedShape(Sphere(0.1), pin.SE3.Identity()),)})
    assert_refused(lambda: Obstacle(Sphere(0.1), links="panda_link0").validate(fixed), RangeError, "no joint moves")


def test_declaration_is_plain_data() -> None:
    bot = robot("panda")
    here = Obstacle(Sphere(0.1), pose=pin.SE3.Identity()).declaration(bot)
    assert here != Obstacle(Sphere(0.1)).declaration(bot)
    assert here != Obstacle(Sphere(0.2), pose=pin.SE3.Identity()).declaration(bot)
    assert here == Obstacle(Sphere(0.1), pose=pin.SE3.Identity()).declaration(bot)
