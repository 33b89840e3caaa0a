"""The arm of the published walker, and its joint rates.

Source: M. R. Patterson's thesis on a three-armed grasping walker, 3.2.2, 4.2 and the listing SOLVE. The thesis prints
formulas, Tables I and II and few numbers; the others are evaluations of its formulas.
"""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

from wbc.published.three_arm_walker.literal import joint_rates, saturated
from wbc.published.three_arm_walker.machine import arm
from wbc.published.three_arm_walker.machine.calibration import Variant

SHOULDER_AND_WRIST: tuple[Variant, ...] = ("listing", "text")


def model() -> pin.Model:
    """The arm by Table II: joint i turns about z of frame i - 1, which the constant part of link i - 1 leads to."""
    out, before = pin.Model(), pin.SE3.Identity()
    for i in range(6):
        turned = before * pin.SE3(pin.AngleAxis(arm.OFFSET[i], np.array([0.0, 0.0, 1.0])).matrix(), np.zeros(3))
        out.addJoint(i, pin.JointModelRZ(), turned, f"joint{i + 1}")
        before = pin.SE3(
            pin.AngleAxis(arm.ALPHA[i], np.array([1.0, 0.0, 0.0])).matrix(), np.array([arm.A[i], 0.0, arm.S[i]])
        )
    out.addFrame(pin.Frame("hand", 6, 0, before, pin.FrameType.OP_FRAME))
    return out


MODEL = model()


def jacobian(theta: np.ndarray) -> np.ndarray:
    return np.asarray(
        pin.computeFrameJacobian(MODEL, MODEL.createData(), theta, MODEL.getFrameId("hand"), pin.LOCAL_WORLD_ALIGNED)
    )


def postures(count: int) -> np.ndarray:
    """Random, within the limits, and not near a singularity."""
    found: list[np.ndarray] = []
    random = np.random.default_rng(2)
    while len(found) < count:
        theta = random.uniform(-arm.TRAVEL, arm.TRAVEL)
        bend = np.sin(theta[1]) + np.sin(theta[1] + theta[2])
        if min(abs(bend), abs(np.sin(theta[2])), abs(np.sin(theta[4]))) > 0.1:
            found.append(theta)
    return np.array(found)


def test_01_the_zero_and_the_starting_posture() -> None:
    for theta, point in ((np.zeros(6), (0.0, 6.0, 66.0)), (arm.START, (18.4816, 6.0, 48.9353))):
        hand = arm.forward(theta)
        assert hand[:3, 3] == pytest.approx(point, abs=1e-4)
        assert hand[:3, :3] == pytest.approx(np.eye(3), abs=1e-12)


def test_01_the_frames_of_table_2_are_those_of_a_second_library() -> None:
    data = MODEL.createData()
    for theta in postures(20):
        pin.framesForwardKinematics(MODEL, data, theta)
        assert arm.forward(theta) == pytest.approx(data.oMf[MODEL.getFrameId("hand")].homogeneous, abs=1e-12)


def test_02_rates_are_the_inverse_of_the_jacobian() -> None:
    random = np.random.default_rng(3)
    for theta in postures(200):
        twist = random.normal(size=6) * np.repeat([10.0, 1.0], 3)
        assert joint_rates(theta, twist) == pytest.approx(np.linalg.solve(jacobian(theta), twist), rel=1e-6, abs=1e-9)


@pytest.mark.parametrize("singular", SHOULDER_AND_WRIST)
@pytest.mark.parametrize("bend", [0.0, 0.0099, -0.0099])
def test_03_a_straight_wrist_makes_what_it_can(singular: Variant, bend: float) -> None:
    """The wrist moves as asked; of the rotation, the parts about axis 5 and z3 are made, by one of both joints."""
    random = np.random.default_rng(4)
    for theta in postures(20):
        theta[4] = bend
        twist = random.normal(size=6) * np.repeat([10.0, 1.0], 3)
        rates = joint_rates(theta, twist, singular)
        assert rates[3 if singular == "listing" else 5] == 0.0
        made = jacobian(theta) @ rates
        axis = arm.forward(theta)[:3, 2]
        wrist = [v[:3] - np.cross(v[3:], arm.HW * axis) for v in (made, twist)]
        assert wrist[0] == pytest.approx(wrist[1], abs=1e-9)
        frame = np.eye(4)
        for joint in range(1, 5):
            frame = frame @ arm.link(joint, theta[joint - 1])
        # Axis 5 is z of frame 4; z3, which axes 4 and 6 share at 0, is x across it in the plane of the forearm
        forearm = (arm.link(1, theta[0]) @ arm.link(2, theta[1]) @ arm.link(3, theta[2]))[:3, 2]
        assert made[3:] @ frame[:3, 2] == pytest.approx(twist[3:] @ frame[:3, 2], abs=1e-9)
        missed = 0.0 if bend == 0.0 else 0.01 * np.abs(rates[[3, 5]]).max()
        assert made[3:] @ forearm == pytest.approx(twist[3:] @ forearm, abs=1e-9 + missed)


def test_04_artificial_limits_cost_little_reach() -> None:
    def wrist(theta2: float, theta3: float) -> np.ndarray:
        hand = arm.forward(np.radians([0.0, theta2, theta3, 0.0, 0.0, 0.0]))
        return np.asarray(hand[:3, 3] - arm.HW * hand[:3, 2])

    shoulder = np.array([0.0, arm.SN, arm.NO])
    lost = 2.0 * arm.ES - np.linalg.norm(wrist(40.0, -1.0) - shoulder)
    assert lost == pytest.approx(0.0013, abs=5e-5)
    bends = np.linspace(1.0, 90.0, 90)
    nearest = max(np.hypot(*wrist(0.5 * bend + 1.0, -bend)[:2]) - arm.SN for bend in bends)
    assert nearest == pytest.approx(0.0293, abs=1e-4)


@pytest.mark.parametrize(
    ("degrees", "joint"),
    [
        ((0, 90, -85, 0, -5, 0), None),
        ((161, 90, -85, 0, -5, 0), 1),
        ((0, 43, -85, 0, -5, 0), 2),
        ((0, 90, -0.5, 0, -5, 0), 3),
        ((0, 90, -85, -136, -5, 0), 4),
        ((0, 90, -85, 0, 106, 0), 5),
        ((0, 90, -85, 0, -5, 271), 6),
    ],
)
def test_04_limits_name_the_joint(degrees: tuple[float, ...], joint: int | None) -> None:
    assert arm.joint_beyond(np.radians(degrees)) == joint


def test_05_saturated_rates_keep_their_direction() -> None:
    random = np.random.default_rng(5)
    limits = random.uniform(0.5, 4.0, 6)
    for rates in random.normal(size=(100, 6)) * 3.0:
        cut = saturated(rates, limits)
        used = np.max(np.abs(rates) / limits)
        if used <= 1.0:
            assert np.array_equal(cut, rates)
        else:
            assert np.max(np.abs(cut) / limits) == pytest.approx(1.0, rel=1e-15)
            assert cut * used == pytest.approx(rates, rel=1e-14)
