"""Where two faces are parallel, the witness point jumps: by how much rows jump, and that distances do not."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

from tests.models import Y, arm
from tests.proximity.world import rows_of, sensor
from wbc.proximity import Body
from wbc.shapes import Box, Cylinder, Sphere

SLAB = Box((0.2, 0.2, 0.02))


def slab_on_a_hinge(tilt: float) -> tuple[float, float, float]:
    """(distance, row's derivative, jump's bound) of a slab that a hinge tilts above a table, 0.1 m over it."""
    bot = arm("hinge", [(Y, (0.0, 0.0, 0.0))])
    table = Body("table", "world", pin.SE3(np.eye(3), np.array([0.0, 0.0, -0.12])), SLAB)
    sensing, numbers = sensor(bot, [(table, Body("slab", "F1", pin.SE3.Identity(), SLAB))], 1)
    q = np.array([tilt])
    sensing.sense(q)
    assert not sensing.doubtful.any()
    return float(numbers["distance"][0]), float(rows_of(bot, numbers, q)[0, 0]), SLAB.size[0] / 2


def test_a_row_jumps_by_the_width_of_the_face() -> None:
    """The lower edge changes sides: from -0.1 m/rad to +0.1 m/rad, the lever arms of the two edges."""
    for tilt in (1e-3, 1e-6):
        left, right = slab_on_a_hinge(-tilt), slab_on_a_hinge(tilt)
        assert left[0] == pytest.approx(right[0], abs=1e-12)
        assert left[0] == pytest.approx(0.1, abs=2.1e-4)
        assert (left[1], right[1]) == (pytest.approx(left[2], abs=2e-4), pytest.approx(-right[2], abs=2e-4))
    assert abs(slab_on_a_hinge(0.0)[1]) <= SLAB.size[0] / 2 + 1e-9


def test_a_normal_jumps_where_two_ways_out_are_as_short() -> None:
    """A ball in a slab's edge, nearer to the top or to the side: distances agree, normals are at right angles."""
    bot = arm("hinge", [(Y, (0.0, 0.0, 0.0))])
    found = []
    for shift in (-1e-6, 1e-6):
        ball = Body("ball", "world", pin.SE3(np.eye(3), np.array([0.095 + shift, 0.0, 0.005])), Sphere(0.01))
        sensing, numbers = sensor(bot, [(ball, Body("slab", "F1", pin.SE3.Identity(), SLAB))], 1)
        sensing.sense(bot.neutral)
        found.append((numbers["distance"][0], numbers["line"][:3].copy()))
    assert found[0][0] == pytest.approx(found[1][0], abs=2e-6)
    assert found[0][1] == pytest.approx([0.0, 0.0, -1.0], abs=1e-9)
    assert found[1][1] == pytest.approx([-1.0, 0.0, 0.0], abs=1e-9)


def test_a_ball_in_a_cylinder_leaves_by_the_shorter_way() -> None:
    """Coal's closed form takes the wall also where the lid is nearer; on the axis it has no answer at all."""
    bot = arm("hinge", [(Y, (0.0, 0.0, 0.0))])
    for x, z, distance, normal, doubtful in [
        (0.01, 0.19, -0.02, [0.0, 0.0, -1.0], None),
        (0.0, 0.19, -0.02, [0.0, 0.0, -1.0], None),
        (0.09, 0.0, -0.02, [-1.0, 0.0, 0.0], False),
    ]:
        ball = Body("ball", "world", pin.SE3(np.eye(3), np.array([x, 0.0, z])), Sphere(0.01))
        can = Body("can", "F1", pin.SE3.Identity(), Cylinder(0.1, 0.4))
        sensing, numbers = sensor(bot, [(ball, can)], 1)
        sensing.sense(bot.neutral)
        assert numbers["distance"][0] == pytest.approx(distance, abs=1e-9)
        assert numbers["line"][:3] == pytest.approx(normal, abs=1e-9)
        assert doubtful is None or bool(sensing.doubtful[0]) is doubtful
