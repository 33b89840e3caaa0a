"""Random trees of bodies with payloads and joints that follow others, on fixed and on floating bases, in both
simulators.
"""

from __future__ import annotations

import pickle
from dataclasses import replace

import mujoco
import numpy as np
import pinocchio as pin
import pytest

import wbc.robots
from tests.random_robots import Drawn, random_model
from tests.refusals import assert_refused
from tests.soak.torque_stacks import followed as obeying
from wbc.errors import RangeError, UnsupportedJointError
from wbc.robot import Coupling, Robot
from wbc.simulation import (
    Command,
    CommandKind,
    Encoders,
    GripKind,
    GrippingMujocoPlant,
    Motors,
    MujocoPlant,
    PinocchioPlant,
    mujoco_model,
)

Vector = np.ndarray


def tree(rng: np.random.Generator, floating: bool) -> Robot:
    """Limbs of hinges and slides of any axis, on a hinge or on nothing."""
    base = pin.JointModelFreeFlyer if floating else pin.JointModelRX
    kinds = {"turning": 0.7, "sliding": 0.3}
    drawn = Drawn(base, limbs=(2, 3), joints=(1, 3), kinds=kinds, far=(0.1, 0.8), turned=True, reach=None)
    return wbc.robots.load(random_model(rng, drawn))


def followed(robot: Robot, rng: np.random.Generator) -> Robot:
    """One or two joints follow others, before or after them in the tree."""
    dofs = rng.permutation(np.arange(robot.base_nv, robot.nv))
    pairs = dofs[: 4 if len(dofs) > 4 else 2].reshape(-1, 2)
    couplings = tuple(Coupling(int(i), int(j), float(rng.normal()), float(0.3 * rng.normal())) for i, j in pairs)
    coupled = replace(robot, couplings=couplings)
    return replace(coupled, neutral=obeying(coupled, robot.neutral, np.zeros(robot.nv))[0])


def state(robot: Robot, rng: np.random.Generator) -> tuple[Vector, Vector, Vector]:
    """q, v and torques; none of the base."""
    q = pin.integrate(robot.model, robot.neutral, 0.5 * rng.normal(size=robot.nv))
    tau = 3.0 * rng.normal(size=robot.nv)
    tau[: robot.base_nv] = 0.0
    return *obeying(robot, q, rng.normal(size=robot.nv)), tau


def load(rng: np.random.Generator) -> pin.Inertia:
    return pin.Inertia(rng.uniform(0.1, 2.0), 0.1 * rng.normal(size=3), np.diag([0.02, 0.03, 0.025]))


def in_mujoco(robot: Robot, q: Vector, v: Vector, tau: Vector, equalities: bool = True) -> Vector:
    """Accelerations, in Pinocchio's order and axes."""
    plant = MujocoPlant(mujoco_model(robot), robot)
    if not equalities:
        plant._model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_EQUALITY)
    plant.reset(q, 0.0, v)
    out, data = np.zeros(robot.nv), plant.data
    places = {name: (robot.dofs(name), int(plant._model.joint(name).dofadr[0])) for name in robot.joint_names}
    for part, begin in places.values():
        data.qfrc_applied[begin : begin + part.stop - part.start] = tau[part]
    mujoco.mj_forward(plant._model, data)
    for part, begin in places.values():
        out[part] = data.qacc[begin : begin + part.stop - part.start]
    if robot.base_nv:
        out[:3] = pin.Quaternion(q[3:7]).matrix().T @ out[:3] - np.cross(v[3:6], v[:3])
    return out


@pytest.mark.parametrize("seed", range(6))
def test_accelerations_agree(seed: int) -> None:
    """To 1e-9 where joints are free. MuJoCo's couplings are springs; Pinocchio's plant has them rigid."""
    rng = np.random.default_rng(seed)
    robot, payload = tree(rng, floating=seed % 2 == 0), load(rng)
    plant = PinocchioPlant(robot, payloads={"a0_link": payload})
    heavy = replace(robot, model=plant.model)
    q, v, tau = state(robot, rng)
    plant.reset(q, 0.0, v)
    found = plant.acceleration(tau)
    assert in_mujoco(heavy, q, v, tau) == pytest.approx(found, abs=1e-9 * np.abs(found).max())

    coupled = followed(robot, rng)
    plant = PinocchioPlant(coupled, payloads={"a0_link": payload})
    q, v, tau = state(coupled, rng)
    plant.reset(q, 0.0, v)
    found, energy = plant.acceleration(tau), plant.energy
    C = np.zeros((len(coupled.couplings), coupled.nv))
    for row, coupling in zip(C, coupled.couplings, strict=True):
        row[coupling.follower], row[coupling.leader] = 1.0, -coupling.ratio
    # What the gears need besides acts along the couplings alone
    needed = pin.rnea(heavy.model, heavy.model.createData(), q, v, found) - tau
    size = np.abs(needed).max() + np.abs(tau).max()
    assert C @ found == pytest.approx(np.zeros(len(C)), abs=1e-12 * np.abs(found).max())
    assert C.T @ np.linalg.lstsq(C.T, needed, rcond=None)[0] == pytest.approx(needed, abs=1e-11 * size)
    heavy = replace(coupled, model=heavy.model)
    free = pin.aba(heavy.model, heavy.model.createData(), q, v, tau)
    assert in_mujoco(heavy, q, v, tau, equalities=False) == pytest.approx(free, abs=1e-9 * np.abs(free).max())
    assert in_mujoco(heavy, q, v, tau) == pytest.approx(found, abs=0.02 * np.abs(found).max())
    plant.advance(0.02)
    after = plant.read()
    assert plant.energy == pytest.approx(energy, rel=1e-8)
    at, rate = obeying(coupled, after.q, after.v)
    assert at == pytest.approx(after.q, abs=1e-12)
    assert rate == pytest.approx(after.v, abs=1e-12 * np.abs(rate).max())


@pytest.mark.parametrize("kind", GripKind)
def test_grips_of_robots_with_joints_that_follow(kind: GripKind) -> None:
    """Without couplings as the other solver says; with them M a + h = tau + J'w + C'f, and the grip holds."""
    rng = np.random.default_rng(7)
    robot = tree(rng, floating=True)
    free = replace(robot, couplings=(Coupling(robot.nv - 1, robot.nv - 2, 1.0),))
    plants = []
    for one in (robot, free):
        plant = PinocchioPlant(one)
        if one is free:  # The coupling is taken off again: what is left is the dense solver alone
            plant._dynamics._G, plant._dynamics.free = np.eye(one.nv), list(range(one.nv))  # type: ignore[attr-defined]
            plant._dynamics.coupled = lambda q, v: (q, v)  # type: ignore[method-assign]
        plants.append(plant)
    q, v, tau = state(robot, rng)
    found = []
    for plant in plants:
        plant.reset(q, 0.0, v)
        plant.grasp("b0_link", robot.pose(q, "b0_link"), kind)
        found.append((plant.state.v, plant.acceleration(tau), plant.wrenches["b0_link"]))
    for one, other in zip(*found, strict=True):
        assert other == pytest.approx(one, abs=1e-6 * max(1.0, np.abs(one).max()))

    coupled = followed(robot, rng)
    plant = PinocchioPlant(coupled)
    q, v, tau = state(coupled, rng)
    plant.reset(q, 0.0, v)
    hold = coupled.pose(q, "b0_link")
    plant.grasp("b0_link", hold, kind)
    plant.apply(Command(CommandKind.TORQUE, tau))
    plant.advance(0.02)
    assert coupled.pose(plant.state.q, "b0_link").translation == pytest.approx(hold.translation, abs=1e-6)
    q, v, a = plant.state.q, plant.state.v, plant.acceleration(tau)
    data, frame = plant.model.createData(), plant.model.getFrameId("b0_link")
    push = pin.computeFrameJacobian(plant.model, data, q, frame, pin.LOCAL).T @ plant.wrenches["b0_link"]
    left = pin.rnea(plant.model, data, q, v, a) - tau - push
    assert np.abs(left).max() > 1e-3  # the gears carry something
    assert plant._dynamics._G.T @ left == pytest.approx(  # type: ignore[attr-defined]
        np.zeros(len(plant._dynamics.free)), abs=1e-9 * np.abs(tau).max()
    )


def test_what_is_refused_of_couplings_and_trees() -> None:
    rng = np.random.default_rng(1)
    coupled = followed(tree(rng, floating=False), rng)
    plant = PinocchioPlant(coupled)
    q, follower = coupled.neutral.copy(), coupled.couplings[0].follower
    q[coupled.position_index[follower]] += 0.1
    assert_refused(lambda: plant.reset(q, 0.0), RangeError, "follows")
    assert_refused(lambda: plant.reset(coupled.neutral, 0.0, np.eye(coupled.nv)[follower]), RangeError, "follows")
    model = pin.Model()
    parents = [model.addJoint(0, pin.JointModelRX(), pin.SE3.Identity(), "root")]
    for name, parent in (("left", 0), ("right", 0), ("left hand", 1)):
        parents.append(model.addJoint(parents[parent], pin.JointModelRY(), pin.SE3.Identity(), name))
    assert_refused(lambda: wbc.robots.load(model), UnsupportedJointError, "left hand")


@pytest.mark.parametrize("seed", range(4))
def test_saved_states_go_on_to_the_same_bits(seed: int) -> None:
    rng = np.random.default_rng(seed)
    robot = tree(rng, floating=seed % 2 == 0)
    q, v, tau = state(robot, rng)
    motors = Motors(delay=0.002, lag=0.005, noise=0.1, viscous=0.1, coulomb=0.05)
    encoders = Encoders(position=1e-5, velocity=1e-4)
    coupled = followed(robot, rng)
    followers = obeying(coupled, q, v)
    for make, at, rate in (
        (lambda: PinocchioPlant(robot, motors=motors, encoders=encoders, seed=seed), q, v),
        (lambda: PinocchioPlant(coupled, motors=motors, encoders=encoders, seed=seed), *followers),
        (lambda: GrippingMujocoPlant(robot, ["a_tip"], motors=motors, seed=seed), q, v),
        (lambda: GrippingMujocoPlant(coupled, ["a_tip"], motors=motors, seed=seed), *followers),
    ):
        ends = []
        for _ in range(2):
            plant = make()
            plant.reset(at, 0.0, rate)
            plant.grasp("a_tip", robot.pose(at, "a_tip"), GripKind.POSITION)
            plant.apply(Command(CommandKind.TORQUE, tau))
            plant.advance(0.005)
            plant.slip("a_tip", (0.01, 0.0, 0.0), 0.01)
            plant.limp(robot.joint_names[-1])
            saved = plant.save()
            carried = pickle.loads(pickle.dumps(saved))
            plant.advance(0.01)
            ends.append((plant.read(), plant.wrenches, plant.given))
            plant.release("a_tip")
            for again in (saved, carried, saved):
                plant.restore(again)
                plant.advance(0.01)
                ends.append((plant.read(), plant.wrenches, plant.given))
        first, wrenches, given = ends[0]
        for end, *others in ends[1:]:
            assert end.q.tobytes() == first.q.tobytes()
            assert end.v.tobytes() == first.v.tobytes()
            assert others[0]["a_tip"].tobytes() == wrenches["a_tip"].tobytes()
            assert others[1].tobytes() == given.tobytes()
    other = PinocchioPlant(wbc.robots.load("panda"))
    assert_refused(lambda: other.restore(saved), RangeError, "another robot")
