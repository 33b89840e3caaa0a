"""Rows of balls against segments: the compiled loop against the expressions, and what it leaves out."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

import wbc
from tests.models import placement
from tests.repeats import ALL, MORE, repeats
from tests.tasks.robots import FRAMES, robot
from wbc.api import Controller
from wbc.controller import core_of
from wbc.shapes import Box, Capsule, PlacedShape, Sphere
from wbc.tasks import EndEffector, JointLimits, Obstacle, Posture

DT = 0.01
#: The first and the last are of the same kind for rows of balls: with ``REPEATS=3`` both
ROBOTS = ("panda", "talos") if MORE < ALL else ("panda", "talos", "kinova")
BALLS = 6


@cache
def stack(name: str, calm: bool = True) -> wbc.Stack:
    """Balls of several sizes, one of radius 0, among other margins, with limits on velocity and acceleration."""
    machine = robot(name)
    speeds = np.where(np.isfinite(machine.limits.velocity), machine.limits.velocity, 1.0)
    machine = machine.with_limits(velocity=speeds, acceleration=10.0)
    out = wbc.Stack(machine, DT, calm=calm)
    out.add(EndEffector(FRAMES[name].tip, kind="position"), name="hand")
    out.add(Posture(), name="posture", weight=1e-2).add(JointLimits())
    links = [link for link, shapes in machine.shapes.items() if shapes and _moved(machine, link)]
    for k in range(BALLS):
        chosen = None if k % 2 else tuple(links[k // 2 :])
        shape: Any = Capsule(0.05, 0.0) if k == 1 else Sphere(0.04 * k)
        out.add(Obstacle(shape, links=chosen, margin=0.01), name=f"ball{k}")
        if k == 2:
            out.add(Obstacle(Capsule(0.05, 0.3), links=chosen), name="capsule")
    return out


def _moved(machine: wbc.Robot, link: str) -> bool:
    return bool(machine.model.frames[machine.model.getFrameId(link)].parentJoint)


@cache
def pair(name: str, calm: bool = True) -> tuple[Controller, Controller]:
    """(native, vm)."""
    return stack(name, calm).compile(backend="native"), stack(name, calm).compile(backend="vm")


def configuration(machine: wbc.Robot, rng: np.random.Generator) -> np.ndarray:
    step = rng.uniform(-1.0, 1.0, machine.nv) * np.where(machine.dof_units == "m", 0.2, 1.0)
    return np.asarray(pin.integrate(machine.model, machine.neutral, 0.5 * step))


def scatter(controllers: tuple[Controller, ...], rng: np.random.Generator, size: float, speed: float) -> None:
    """Balls anywhere within a cube, rotated, turning and flying; the same in all controllers."""
    for k in range(BALLS):
        pose = pin.SE3(pin.exp3(rng.uniform(-2, 2, 3)), rng.uniform(-size, size, 3))
        velocity, rate = rng.uniform(-speed, speed, 6), rng.uniform(1.0, 0.5 / DT)
        for controller in controllers:
            controller[f"ball{k}"].set(pose=pose, velocity=velocity, rate=rate)


def gaps(machine: wbc.Robot, obstacle: Any, center: np.ndarray, q: np.ndarray) -> np.ndarray:
    """Of a ball's centre from the segments of the links that keep clear of it, less radii and margin, by Pinocchio."""
    out = []
    for link, shapes in machine.shapes.items():
        if _moved(machine, link) and link in (obstacle.links or machine.shapes):
            for placed in shapes:
                seen = (placement(machine, link, q) * placed.placement).actInv(center)
                half = getattr(placed.shape, "length", 0.0) / 2
                nearest = np.array([0.0, 0.0, np.clip(seen[2], -half, half)])
                out.append(np.linalg.norm(seen - nearest) - placed.shape.radius)
    return np.array(out) - obstacle.shape.radius - obstacle.margin


@pytest.mark.parametrize(("name", "calm"), [("panda", False), *((name, True) for name in ROBOTS)])
def test_margins_and_sides_are_those_of_segments(name: str, calm: bool) -> None:
    """Now, a tick later, and where a flying ball is soon; both back ends compute rows of balls in the same C."""
    rng, controllers, machine = np.random.default_rng(0), pair(name, calm), stack(name).robot
    items = {entry.name: entry.item for entry in stack(name, calm).entries if entry.name.startswith("ball")}
    for _ in range(repeats(5)):
        q = configuration(machine, rng)
        scatter(controllers, rng, 1.0, 0.5)
        for controller in controllers:
            controller.reset(q)
            step, qp = controller.step(q), core_of(controller).tick.qp()
            counts, later = [len(h) for h in step.margins.values()], machine.integrate(q, step.v, DT)
            parts = np.split(qp.lower[-sum(counts) :], np.cumsum(counts)[:-1])
            sides = dict(zip(step.margins, parts, strict=True))
            for ball, item in items.items():
                center, velocity = controller[ball].pose.translation, controller[ball].velocity[:3]
                now = gaps(machine, item, center, q)
                np.testing.assert_allclose(step.margins[ball], now, atol=1e-12)
                soon = gaps(machine, item, center + DT * velocity, later)
                np.testing.assert_allclose(step.margins_ahead[ball], soon, atol=1e-12)
                if not calm:
                    moved = [gaps(machine, item, center + sign * 1e-6 * velocity, q) for sign in (1.0, -1.0)]
                    kept = -controller[ball].rate * now - (moved[0] - moved[1]) / 2e-6
                    np.testing.assert_allclose(sides[ball], kept, atol=1e-7)


@pytest.mark.parametrize("name", ROBOTS)
def test_rows_are_how_fast_margins_change(name: str) -> None:
    """By differences: both back ends compute rows of balls in the same C."""
    rng, (native, vm), machine = np.random.default_rng(2), pair(name), stack(name).robot

    def margins(q: np.ndarray) -> np.ndarray:
        native.reset(q)
        return np.concatenate([np.ravel(each) for each in native.step(q).margins.values()])

    q = configuration(machine, rng)
    scatter((native, vm), rng, 1.0, 0.5)
    by = [1e-6 * each for each in np.eye(machine.nv)]
    change = [(margins(machine.integrate(q, d, 1.0)) - margins(machine.integrate(q, -d, 1.0))) / 2e-6 for d in by]
    margins(q)
    rows = core_of(native).tick.qp().A[-len(change[0]) :]
    assert np.abs(rows - np.transpose(change)).max() < 1e-7


@pytest.mark.parametrize("place", [(0.0, 0.0, 0.0), (0.0, 0.0, 0.07), (1e-9, 0.0, 0.02)])
def test_a_ball_on_the_core_of_a_link_has_a_direction_to_leave_in(place: tuple[float, float, float]) -> None:
    """The same declared one in both."""
    controllers, machine = pair("panda"), stack("panda").robot
    q = machine.neutral
    for link, shapes in machine.shapes.items():
        for placed in shapes:
            if not _moved(machine, link):
                continue
            pose = placement(machine, link, q) * placed.placement
            matrices = []
            for controller in controllers:
                controller["ball3"].set(pose=pin.SE3(np.eye(3), pose.act(np.array(place))), velocity=np.zeros(6))
                controller.reset(q)
                step = controller.step(q)
                assert np.isfinite(step.v).all()
                matrices.append(core_of(controller).tick.qp().A)
            assert np.isfinite(matrices[0]).all()
            assert np.abs(matrices[0] - matrices[1]).max() < 1e-5
            assert np.abs(matrices[0]).max() > 0.05


@pytest.mark.parametrize(("name", "calm"), [*((name, True) for name in ROBOTS), ("panda", False)])
def test_rows_that_are_left_out_hold_whatever_the_joints_do(name: str, calm: bool) -> None:
    """In motion: for every velocity within the bounds, with the limit for braking in front of a margin."""
    rng, (native, vm) = np.random.default_rng(1), pair(name, calm)
    machine, left_out, kept, bound = stack(name, calm).robot, 0, 0, 0
    n = machine.nv
    for trial in range(3):
        q = configuration(machine, rng)
        scatter((native, vm), rng, 0.8, 0.1 * trial)
        # Into one of the balls that the hand keeps clear of
        target = native["ball5"].pose.translation
        for controller in (native, vm):
            controller.reset(q)
            controller["hand"].target = target
        for tick in range(150):
            core_of(vm).tick.v_last[:] = core_of(native).tick.v_last
            step = native.step(q)
            bound += any(b.item.startswith("ball") for b in step.binding)
            # Three ticks do not differ in more than one does
            if tick % 3 == 0:
                low = core_of(native).tick._low[n:].copy()
                full = core_of(native).tick.qp()
                far = (low <= -1e29) & np.isfinite(full.lower[n:])
                least = np.minimum(full.A[far] * full.lower[:n], full.A[far] * full.upper[:n]).sum(axis=1)
                assert (least >= full.lower[n:][far]).all()
                reference = vm.step(q)
                if reference.status == "solved":
                    assert np.abs(step.v - reference.v).max() < 1e-6
                left_out, kept = left_out + int(far.sum()), kept + int((~far).sum())
            q = pin.integrate(machine.model, q, step.v * DT)
    assert left_out > 0.2 * (left_out + kept)
    assert bound >= 10


def test_other_shapes_are_no_balls() -> None:
    machine = robot("panda")
    boxed = machine.with_shapes({"panda_link5": [PlacedShape(Box((0.1, 0.1, 0.1)), pin.SE3.Identity())]})
    assert Obstacle(Sphere(0.1)).ball_rows(machine)
    assert not Obstacle(Capsule(0.1, 0.2)).ball_rows(machine)
    assert not Obstacle(Sphere(0.1)).ball_rows(boxed)
