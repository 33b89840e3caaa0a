"""Objects in hands: their mass, their shape, and that they are guarded as links are."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

import wbc
from tests.refusals import assert_refused
from wbc.errors import DuplicateNameError, RangeError, ShapeError, UnknownNameError
from wbc.robots import carry
from wbc.shapes import Box, Capsule, Convex, Cylinder, Sphere

TIP = "panda_hand_tcp"
PLACE = pin.SE3(pin.exp3(np.array([0.3, -0.2, 0.1])), np.array([0.02, 0.01, 0.1]))


@pytest.fixture(scope="module")
def panda() -> wbc.Robot:
    return wbc.robots.load("panda")


@pytest.mark.parametrize(
    ("shape", "spread"),
    [
        (Box((0.1, 0.2, 0.3)), np.array([0.2**2 + 0.3**2, 0.1**2 + 0.3**2, 0.1**2 + 0.2**2]) / 12),
        (Sphere(0.1), np.full(3, 0.4 * 0.01)),
        (Cylinder(0.1, 0.4), np.array([0.01 / 4 + 0.16 / 12] * 2 + [0.01 / 2])),
        (Capsule(0.1, 0.0), np.full(3, 0.4 * 0.01)),
    ],
)
def test_its_mass_is_the_robots(panda: wbc.Robot, shape: wbc.shapes.Solid, spread: np.ndarray) -> None:
    holding, q, rng = (
        carry(panda, "box", TIP, shape, placement=PLACE, mass=2.0),
        panda.random(3),
        np.random.default_rng(1),
    )
    v = rng.uniform(-1, 1, panda.nv)
    energies = [pin.computeKineticEnergy(r.model, r.model.createData(), q, v) for r in (panda, holding)]
    jacobian, turn = holding.jacobian(q, "box"), holding.pose(q, "box").rotation
    linear, angular = np.split(jacobian @ v, 2)
    own = 0.5 * 2.0 * (linear @ linear + (turn.T @ angular) @ (spread * (turn.T @ angular)))
    assert energies[1] - energies[0] == pytest.approx(own, rel=1e-9)
    assert holding.pose(q, "box", TIP).homogeneous == pytest.approx(PLACE.homogeneous)
    assert panda.shapes.keys() == holding.shapes.keys() - {"box"}
    assert holding.fingerprint != panda.fingerprint


def test_it_is_guarded_as_a_link(panda: wbc.Robot) -> None:
    holding = carry(panda, "box", TIP, Sphere(0.06), placement=(np.array([0.0, 0.0, 0.08]), [0, 0, 0, 1]))
    assert panda.self_pairs
    assert holding.self_pairs
    with_box = {link for pair in holding.self_pairs if "box" in pair for link in pair} - {"box"}
    assert set(panda.self_pairs) < set(holding.self_pairs)
    assert {"panda_link0", "panda_link1", "panda_link2"} <= with_box
    assert not {"panda_hand", "panda_link7"} & with_box
    stack = wbc.Stack(holding, dt=0.01)
    stack.add(wbc.tasks.EndEffector(TIP, kind="position", gain=5.0), name="hand")
    stack.add(wbc.tasks.Obstacle(wbc.shapes.HalfSpace(), links=("box",), margin=0.0), name="table")
    stack.add(wbc.tasks.Posture(), name="posture", weight=1e-3)
    controller = stack.compile(backend="vm")
    low = {}
    for guarded in (True, False):
        q = holding.neutral
        controller.reset(q)
        controller["table"].enabled = guarded
        controller["hand"].target = [0.45, 0.0, 0.05]
        for _ in range(150):
            q = holding.integrate(q, controller.step(q).v, 0.01)
        low[guarded] = holding.pose(q, "box").translation[2] - 0.06
    assert low[True] == pytest.approx(0.0, abs=1e-3)
    assert low[False] < -0.02


def test_what_cannot_be_carried_is_refused(panda: wbc.Robot) -> None:
    ball = Sphere(0.1)
    assert_refused(lambda: carry(panda, "box", "hand", ball), UnknownNameError, "panda_hand")
    assert_refused(lambda: carry(panda, TIP, TIP, ball), DuplicateNameError, TIP)
    assert_refused(lambda: carry(panda, "box", "panda_link0", ball), RangeError, "does not move")
    assert_refused(lambda: carry(panda, "box", TIP, ball, mass=-1.0), RangeError, "mass")
    assert_refused(lambda: carry(panda, "box", TIP, "ball"), ShapeError, "Sphere")  # type: ignore[arg-type]
    hull = Convex(np.eye(4, 3))
    assert_refused(lambda: carry(panda, "box", TIP, hull, mass=1.0), ShapeError, "Convex")
    assert carry(panda, "box", TIP, hull, inertia=pin.Inertia.FromSphere(1.0, 0.1)).frame_names[-1] == "box"
