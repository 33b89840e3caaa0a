"""Residuals of the generalised momentum, and motors that give less than they are commanded."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

from tests.refusals import assert_refused
from tests.simulation.machines import heavy, velocity
from wbc.climb.loop.motor_watch import LOOKS, MotorWatch
from wbc.errors import RangeError
from wbc.estimation import MomentumObserver
from wbc.simulation import Command, CommandKind, Motors, PinocchioPlant

ROBOT, LIMP = heavy().robot, "arm1_joint2"
DOF = ROBOT.dofs(LIMP).start


def driven(**plant: object) -> tuple[PinocchioPlant, np.ndarray]:
    """Swinging freely under random torques, of which every tenth is large."""
    out = PinocchioPlant(ROBOT, integrator="midpoint", **plant)  # type: ignore[arg-type]
    out.reset(ROBOT.neutral, 0.0, v=velocity(ROBOT, 0.2))
    tau = np.random.default_rng(0).normal(size=ROBOT.nv)
    tau[: ROBOT.base_nv], tau[DOF] = 0.0, 80.0
    out.apply(Command(CommandKind.TORQUE, tau))
    return out, tau


def test_it_is_what_is_missing_from_one_joint_and_nothing_else() -> None:
    plant, tau = driven()
    observer = MomentumObserver(ROBOT.model, 100.0, 0.001)
    observer.begin(plant.state.q, plant.state.v)
    plant.limp(LIMP, 0.25)
    for _ in range(120):
        plant.advance(0.001)
        residual = observer.update(plant.state.q, plant.state.v, tau)
    missing = np.zeros(ROBOT.nv)
    missing[DOF] = -0.75 * 80.0
    assert residual == pytest.approx(missing, abs=0.02)


@pytest.mark.parametrize("delay", [0.0, 0.0025])
@pytest.mark.parametrize(("scale", "found"), [(0.0, [DOF]), (0.1, [DOF]), (0.5, []), (1.0, [])])
def test_a_limp_motor_is_found_by_its_joint(scale: float, found: list[int], delay: float) -> None:
    plant, tau = driven(motors=Motors(viscous=1.0))
    watch = MotorWatch(ROBOT, 0.001, delay)
    watch.begin(plant.state.q, plant.state.v)
    plant.limp(LIMP, scale)
    for tick in range(1, 40 * LOOKS):
        plant.advance(0.001)
        if watch.sends(tau):
            assert tick % LOOKS == 0
            watch.see(plant.state.q, plant.state.v, np.zeros(ROBOT.nv))
    assert watch.limp == found


def test_mimic_joints_of_pinocchio_are_refused() -> None:
    joint = '<joint name="{}" type="revolute"><parent link="{}"/><child link="{}"/><axis xyz="0 0 1"/>{}</joint>'
    joints = joint.format("lead", "a", "b", ""), joint.format("tip", "b", "c", '<mimic joint="lead" multiplier="2"/>')
    text = '<robot name="r"><link name="a"/><link name="b"/><link name="c"/>' + "".join(joints) + "</robot>"
    limits = '<limit lower="-1" upper="1" effort="1" velocity="1"/>'
    model = pin.buildModelFromXML(text.replace("</joint>", limits + "</joint>"), mimic=True)
    assert_refused(lambda: MomentumObserver(model, 50.0, 0.001), RangeError, "model")


def test_gains_that_are_none_are_refused() -> None:
    assert_refused(lambda: MomentumObserver(ROBOT.model, 0.0, 0.001), RangeError, "gain")
    assert_refused(lambda: MomentumObserver(ROBOT.model, 2000.0, 0.001), RangeError, "gain")
    assert_refused(lambda: MomentumObserver(ROBOT.model, 50.0, 0.0), RangeError, "dt")
