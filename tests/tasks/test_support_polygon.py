"""The constraint that keeps the centre of mass over the contacts."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest
from scipy.spatial import Delaunay

import wbc
from tests.refusals import assert_refused
from wbc.errors import RangeError, ShapeError, UnknownNameError
from wbc.tasks import support_planes, support_polygon

SOLE = [(x, y, 0.0) for x in (-0.09, 0.11) for y in (-0.06, 0.06)]


@pytest.fixture(scope="module")
def talos() -> wbc.Robot:
    return wbc.robots.load("talos", shapes="none")


def test_planes_are_the_hull_of_the_corners(talos: wbc.Robot) -> None:
    rng, feet = np.random.default_rng(0), ("left_sole_link", "right_sole_link")
    planes = support_planes(talos, dict.fromkeys(feet, SOLE))
    normals, offsets = planes["normals"].reshape(-1, 2), planes["offsets"]
    corners = np.concatenate([
        (talos.pose(talos.neutral, foot).homogeneous @ np.c_[np.array(SOLE), np.ones(4)].T).T[:, :2] for foot in feet
    ])  # fmt: skip
    inside = Delaunay(corners)
    for point in rng.uniform(-0.3, 0.3, (200, 2)):
        assert bool((normals @ point >= offsets).all()) == bool(inside.find_simplex(point) >= 0)
    # As many rows as asked for, of the same hull; the margin is a distance
    more = support_planes(talos, dict.fromkeys(feet, SOLE), margin=0.01, edges=9)
    assert more["offsets"].shape == (9,)
    assert more["offsets"][: len(offsets)] == pytest.approx(offsets + 0.01)
    assert np.linalg.norm(normals, axis=1) == pytest.approx(1.0)


def test_a_pull_over_the_edge_ends_at_the_margin_and_a_lifted_foot_is_a_new_hull(talos: wbc.Robot) -> None:
    contacts = {"left_sole_link": SOLE, "right_sole_link": SOLE}
    stack = wbc.Stack(talos, dt=0.02)
    stack.add(wbc.tasks.CenterOfMass(weights=(1, 1, 0)), name="pull")
    for foot in contacts:
        stack.add(wbc.tasks.Hold(foot), name=foot)
    stack.add(wbc.tasks.Posture(), name="posture", weight=1e-4)
    stack.add(support_polygon(talos, contacts, margin=0.01, edges=8), name="polygon")
    controller, q = stack.compile(backend="vm"), talos.neutral
    controller.reset(q)
    controller["pull"].target = controller["pull"].target + [0.0, 0.4, 0.0]
    for _ in range(120):
        step = controller.step(q)
        q = talos.integrate(q, step.v, stack.dt)
        assert step.margins["polygon"].min() > -1e-4
    place = pin.centerOfMass(talos.model, talos.model.createData(), q)
    edge = talos.pose(q, "left_sole_link").translation[1] + 0.06
    assert edge - place[1] == pytest.approx(0.01, abs=1e-4)
    # On the right foot alone the robot would fall: the row gives way and says so
    controller["polygon"].set(**support_planes(talos, {"right_sole_link": SOLE}, q, margin=0.01, edges=8))
    assert controller.step(q).margins["polygon"].min() < -0.05


def test_bad_contacts_are_refused(talos: wbc.Robot) -> None:
    assert_refused(lambda: support_polygon(talos, {"sole": SOLE}), UnknownNameError, "sole")
    assert_refused(lambda: support_polygon(talos, {"left_sole_link": SOLE[:2]}), RangeError, "three corners")
    assert_refused(lambda: support_polygon(talos, {"left_sole_link": [(0, 0)]}), ShapeError, "n x 3")
    line = [(0.0, 0.0, 0.0), (0.1, 0.0, 0.0), (0.2, 0.0, 0.0)]
    assert_refused(lambda: support_polygon(talos, {"left_sole_link": line}), RangeError, "line")
    assert_refused(lambda: support_polygon(talos, {"left_sole_link": SOLE}, margin=0.1), RangeError, "margin")
    assert_refused(lambda: support_polygon(talos, {"left_sole_link": SOLE}, edges=3), RangeError, "4")
    hand = {"left_sole_link": SOLE, "gripper_left_base_link": SOLE}
    assert_refused(lambda: support_polygon(talos, hand), RangeError, "one plane")
