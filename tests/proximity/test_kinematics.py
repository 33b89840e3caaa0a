"""Bodies are where Pinocchio says, on every type of joint."""

from __future__ import annotations

import itertools

import numpy as np
import pinocchio as pin
import pytest

from tests.models import robot as bare
from tests.symbolic.chains import KINDS, chain, unaligned_unbounded
from tests.symbolic.referee import random_state
from tests.symbolic.test_joints import FOLLOWERS, mimicking
from wbc.proximity import Body, witnesses
from wbc.shapes import Sphere

POINTS = np.vstack([np.zeros(3), np.eye(3)])


def errors(model: pin.Model, frames: tuple[str, ...]) -> float:
    """How far four points fixed to each frame are from where Pinocchio has them [m]."""
    bot = bare("any", model)
    there = Body("there", "world", pin.SE3(np.eye(3), np.array([0.0, 0.0, 50.0])), Sphere(0.0))
    pairs = [(Body("p", f, pin.SE3(np.eye(3), p), Sphere(0.0)), there) for f in frames for p in POINTS]
    data, worst = model.createData(), 0.0
    for k in range(3):
        q, _, _ = random_state(model, f"{frames} {k}")
        pin.framesForwardKinematics(model, data, q)
        truth = [data.oMf[model.getFrameId(f)].act(p) for f in frames for p in POINTS]
        found = [w.on_first for w in witnesses(bot, pairs, q)]
        worst = max(worst, float(np.abs(np.array(found) - truth).max()))
    return worst


@pytest.mark.parametrize("kind", KINDS)
def test_every_joint_type(kind: str) -> None:
    model = chain([pin.JointModelRZ(), KINDS[kind](), pin.JointModelRX()])
    assert errors(model, ("tip", "branch_tip")) < 1e-12


BOUNDED = [name for name in FOLLOWERS if name != "unbounded"]


@pytest.mark.parametrize(
    ("leader", "follower"), [*itertools.product(BOUNDED, BOUNDED), ("unbounded", "unbounded")], ids=str
)
def test_every_mimic_joint(leader: str, follower: str) -> None:
    """Pinocchio takes no joint with end for the follower of one without."""
    assert errors(mimicking(FOLLOWERS[leader](), FOLLOWERS[follower]()), ("tip", "branch_tip")) < 1e-12


def test_a_continuous_joint_about_a_slanted_axis() -> None:
    assert errors(unaligned_unbounded(), ("l1", "l2")) < 1e-12
