"""Published pitch-plane rates and loci: E. Dupuis, "A General Framework for the Manual Teleoperation of Kinematically
Redundant Space-Based Manipulators", PhD thesis, McGill University, 2001, chapter 4.

The thesis gives symbols and loci, no numbers; numeric instances are evaluations of its formulas at stated states
with the Space Station arm's dimensions of Nguyen and Hughes (1994). Where a printed formula is wrong, the corrected
one is tested and the printed one is shown to fail.
"""

from __future__ import annotations

import functools
from itertools import product

import casadi as ca
import numpy as np
import pinocchio as pin
import pytest

from tests import models
from wbc.robot import Robot
from wbc.symbolic import Kinematics, Tracer
from wbc.tasks.pitch_plane import PitchPlane

HALF = np.pi / 2
STATE = np.array([0.3, 0.4, -0.5, 1.2, 0.7, -0.6, 0.9])
FOUR_STATE = np.array([0.3, 0.5, -0.7, 1.1])


class Arm:
    """A robot with the rows of the thesis: tip twist, elbow point, alpha, beta."""

    def __init__(self, robot: Robot, wrist: str = "F5", prefix: str = "", base: str = "world") -> None:
        self.robot, self.prefix, self.data = robot, prefix, robot.model.createData()
        self.item = PitchPlane(prefix + "F3", prefix + "F4", prefix + wrist, axis=prefix + "joint3", base=base)
        self.item.validate(robot)
        kin = Tracer(Kinematics(robot.model))
        row = ca.densify(self.item.jacobian(robot, kin, {}))
        factor = kin.expand(self.item.row_factor(robot, kin, {}))
        self.function = ca.Function("alpha", [kin.q], [row, factor])

    def alpha(self, q: np.ndarray) -> np.ndarray:
        return np.array(self.function(q)[0])

    def factor(self, q: np.ndarray) -> float:
        return float(self.function(q)[1])

    def frame(self, name: str, q: np.ndarray) -> np.ndarray:
        """6 x nv, [v; omega], world axes."""
        model = self.robot.model
        frame = model.getFrameId(self.prefix + name)
        return pin.computeFrameJacobian(model, self.data, q, frame, pin.LOCAL_WORLD_ALIGNED)

    def place(self, name: str, q: np.ndarray) -> pin.SE3:
        model = self.robot.model
        pin.framesForwardKinematics(model, self.data, q)
        return self.data.oMf[model.getFrameId(self.prefix + name)].copy()

    def xi(self, q: np.ndarray) -> np.ndarray:
        return self.frame("tip", q)

    def elbow(self, q: np.ndarray) -> np.ndarray:
        return self.frame("F4", q)[:3]

    def beta(self, q: np.ndarray) -> np.ndarray:
        """Pitch axis times the angular velocity of body 2 (eq. 4.9)."""
        return (self.place("F3", q).rotation[:, 1] @ self.frame("F2", q)[3:])[None]

    def det(self, q: np.ndarray) -> float:
        return float(np.linalg.det(np.vstack([self.xi(q), self.alpha(q)])))


@functools.cache
def four() -> Arm:
    return Arm(models.four_joint_arm(), wrist="tip")


@functools.cache
def ssrms() -> Arm:
    return Arm(models.ssrms())


@functools.cache
def simple() -> Arm:
    return Arm(models.arm("simple", models.ssrms_links(1.0, 0.0, 0.0, 0.0, 0.0)))


@functools.cache
def spdm() -> Arm:
    return Arm(models.spdm_arm())


def rank(*rows: np.ndarray) -> int:
    sigma = np.linalg.svd(np.vstack(rows), compute_uv=False)
    return int((sigma > 1e-9 * sigma[0]).sum())


def smallest(*rows: np.ndarray) -> float:
    return float(np.linalg.svd(np.vstack(rows), compute_uv=False)[-1])


def states(count: int, size: int = 7, seed: int = 1) -> np.ndarray:
    return np.random.default_rng(seed).uniform(-np.pi, np.pi, (count, size))


# --- four-joint arm, section 4.1 -----------------------------------------------------------------


def four_row(q: np.ndarray, upper: float = 1.0, fore: float = 0.8) -> np.ndarray:
    """Eqs. (4.6), (4.7)."""
    size = np.sqrt(upper**2 + fore**2 + 2 * upper * fore * np.cos(q[3]))
    first = np.cos(q[1]) * (upper * np.cos(q[2]) + fore * np.cos(q[2] + q[3]))
    second = upper * np.sin(q[2]) + fore * np.sin(q[2] + q[3])
    return np.array([[first, second, 0.0, 0.0]]) / size


def test_row_of_the_four_joint_arm() -> None:
    for q in states(200, 4):
        np.testing.assert_allclose(four().alpha(q), four_row(q), rtol=0, atol=1e-12)


def test_four_joint_instance() -> None:
    q, arm = FOUR_STATE, four()
    tip = [1.3178578196, -0.7861081106, 0.1050647423]
    np.testing.assert_allclose(arm.place("tip", q).translation, tip, atol=1e-9)
    np.testing.assert_allclose(arm.place("F4", q).translation, [0.6712121662, -0.5406867876, 0.5070818728], atol=1e-9)
    across = arm.place("tip", q).translation - arm.place("F3", q).translation
    assert np.linalg.norm(across) == pytest.approx(1.5381007101, abs=1e-9)
    np.testing.assert_allclose(arm.alpha(q), [[0.8568085373, -0.2162946881, 0, 0]], atol=1e-9)
    both = np.vstack([arm.xi(q)[:3], arm.alpha(q)])
    assert np.linalg.det(both) == pytest.approx(0.9623687431, abs=1e-9)


def test_four_joint_determinant() -> None:
    """det[x4; alpha] = L3 L4 s4 c2 |r|, the loci (4.8)."""
    for q in states(100, 4, seed=2):
        size = np.sqrt(1 + 0.64 + 1.6 * np.cos(q[3]))
        want = 0.8 * np.sin(q[3]) * np.cos(q[1]) * size
        both = np.vstack([four().xi(q)[:3], four().alpha(q)])
        assert np.linalg.det(both) == pytest.approx(want, abs=1e-12)


@pytest.mark.parametrize(
    ("tip", "rate", "expected"),
    [
        ((0, 0, 0), 0.1, (0.1112519970, -0.0216294688, -0.0533370486, 0.0)),
        ((0.05, 0, 0), 0.0, (-0.0038411765, -0.0152160595, 0.0471905478, -0.0924208186)),
    ],
)
def test_four_joint_motions(tip: tuple[float, ...], rate: float, expected: tuple[float, ...]) -> None:
    """Self-motion by alpha, and tip motion with the plane held (4.12), (4.14)."""
    rows = np.vstack([four().xi(FOUR_STATE)[:3], four().alpha(FOUR_STATE)])
    np.testing.assert_allclose(np.linalg.solve(rows, [*tip, rate]), expected, atol=1e-9)


def test_plane_rate_of_an_elbow_command() -> None:
    """Tip fixed, elbow asked for (0, 0.1, 0) in least squares (4.18): the plane turns at -0.1808674 rad/s."""
    arm, q = four(), FOUR_STATE
    still = np.linalg.svd(arm.xi(q)[:3])[2][-1]
    along = arm.elbow(q) @ still
    v = still * (along @ [0, 0.1, 0]) / (along @ along)
    np.testing.assert_allclose(v, (-0.20121863, 0.03912067, 0.09646935, 0.0), atol=1e-7)
    np.testing.assert_allclose(arm.elbow(q) @ v, (0.04019440, 0.07028922, 0.02174300), atol=1e-7)
    assert np.linalg.norm(arm.elbow(q) @ v - [0, 0.1, 0]) == pytest.approx(0.0545076, abs=1e-6)
    assert (arm.alpha(q) @ v).item() == pytest.approx(-0.1808674, abs=1e-6)


@pytest.mark.parametrize(
    ("q2", "with_alpha", "with_beta"),
    [
        (0, 0.424124, 0),
        (0.5, 0.421499, 0.390733),
        (1.2, 0.261023, 0.414274),
        (1.5, 0.050729, 0.414638),
        (HALF, 0, 0.414650),
    ],
)
def test_four_joint_conditioning(q2: float, with_alpha: float, with_beta: float) -> None:
    arm, q = four(), np.array([0.3, q2, -0.7, 1.1])
    task = arm.xi(q)[:3]
    assert smallest(task, arm.alpha(q)) == pytest.approx(with_alpha, abs=5e-6)
    assert smallest(task, arm.beta(q)) == pytest.approx(with_beta, abs=5e-6)


def test_four_joint_ranks_on_the_loci() -> None:
    """(4.8); and (4.10): with beta only q4 in {0, pi} is left, the second printed branch has full rank."""
    arm = four()
    for q1, q3 in states(5, 2, seed=3):
        for q4 in (0.0, np.pi):
            q = np.array([q1, 0.4, q3, q4])
            assert rank(arm.xi(q)[:3], arm.alpha(q)) == 3
            assert rank(arm.xi(q)[:3], arm.alpha(q), arm.beta(q)) == 3
        for q2 in (HALF, -HALF):
            q = np.array([q1, q2, q3, 1.1])
            assert rank(arm.xi(q)[:3]) == rank(arm.xi(q)[:3], arm.alpha(q)) == 3
            assert rank(arm.xi(q)[:3], arm.alpha(q), arm.beta(q)) == 4
            # L3 c3 + L4 c34 = 0
            q[2] = np.arctan2(1 + 0.8 * np.cos(1.1), 0.8 * np.sin(1.1))
            assert abs(np.cos(q[2]) + 0.8 * np.cos(q[2] + q[3])) < 1e-12
            assert rank(arm.xi(q)[:3]) == 2
            assert rank(arm.xi(q)[:3], arm.alpha(q), arm.beta(q)) == 4


# --- simplified Space Station arm, section 4.2 ----------------------------------------------------


def test_simplified_determinant() -> None:
    for q in states(100, seed=4):
        want = np.cos(q[1]) * np.cos(q[5]) * np.sin(q[3]) * np.sqrt(2 * (1 + np.cos(q[3])))
        assert simple().det(q) == pytest.approx(want, abs=1e-12)


def test_simplified_algorithmic_loci() -> None:
    """(4.21): {xi, alpha} is deficient at q2 = +-pi/2 and q6 = +-pi/2 where xi has full rank."""
    for joint, sign in product((1, 5), (1, -1)):
        q = STATE.copy()
        q[joint] = sign * HALF
        assert rank(simple().xi(q)) == 6
        assert rank(simple().xi(q), simple().alpha(q)) == 6
    assert rank(simple().xi(STATE), simple().alpha(STATE)) == 7


# --- Space Station arm with offsets, section 4.3 ---------------------------------------------------


def ssrms_det(q: np.ndarray, boom: float, d: float) -> float:
    c4, s4 = np.cos(q[3]), np.sin(q[3])
    sines = np.sin(q[2]) + np.sin(q[2] + q[3]) + np.sin(q[4]) + np.sin(q[3] + q[4])
    lead = np.cos(q[1]) * np.cos(q[5]) * boom**2 * s4
    return float(lead * (2 * boom * (1 + c4) + d * sines) / np.sqrt(2 * (1 + c4)))


def test_ssrms_instance() -> None:
    arm = ssrms()
    np.testing.assert_allclose(
        arm.place("tip", STATE).translation, [9.964186073, -4.401697152, -3.134509474], atol=1e-8
    )
    np.testing.assert_allclose(arm.place("F4", STATE).translation, [5.340432612, -4.455087714, 2.925406042], atol=1e-8)
    assert arm.det(STATE) == pytest.approx(393.600601349982, rel=1e-12)


def test_ssrms_determinant() -> None:
    for q in states(100, seed=5):
        assert ssrms().det(q) == pytest.approx(ssrms_det(q, 7.11, -0.7026), rel=1e-9, abs=1e-9)


@pytest.mark.parametrize("seed", range(4))
def test_ssrms_determinant_of_other_dimensions(seed: int) -> None:
    """Independent of the lateral offsets and of the tool."""
    boom, z6, y3, y5, x7 = np.random.default_rng(seed).uniform(0.2, 2.0, 5)
    arm = Arm(models.arm("any", models.ssrms_links(boom, z6, y3, y5, x7)))
    for q in states(25, seed=seed):
        assert arm.det(q) == pytest.approx(ssrms_det(q, boom, z6), rel=1e-9, abs=1e-10)


def test_ssrms_row_is_the_rate_about_the_common_normal() -> None:
    """alpha = (r / |r|).omega_2 with r the common normal of the shoulder and wrist pitch axes."""
    arm = ssrms()
    for q in states(100, seed=6):
        y = arm.place("F3", q).rotation[:, 1]
        r = arm.place("F5", q).translation - arm.place("F3", q).translation
        r = r - y * (y @ r)
        assert abs(y @ arm.place("F5", q).rotation[:, 1]) == pytest.approx(1, abs=1e-12)
        want = r / np.linalg.norm(r) @ arm.frame("F2", q)[3:]
        np.testing.assert_allclose(arm.alpha(q)[0], want, rtol=0, atol=1e-12)
        np.testing.assert_array_equal(arm.alpha(q)[0, 2:], np.zeros(5))


@pytest.mark.parametrize(
    ("twist", "rate", "expected"),
    [
        (
            (0, 0, 0, 0, 0, 0),
            0.01,
            (0.01085322, 0.000535521, -0.005913812, 0.000851588, 0.002359217, 0.009760005, -0.002698056),
        ),
        (
            (0.02, 0, 0, 0, 0, 0.005),
            0.0,
            (0.000074111, -0.000680329, 0.002826383, -0.005746076, 0.007088329, -0.000061946, -0.005023596),
        ),
    ],
)
def test_ssrms_motions(twist: tuple[float, ...], rate: float, expected: tuple[float, ...]) -> None:
    arm = ssrms()
    v = np.linalg.solve(np.vstack([arm.xi(STATE), arm.alpha(STATE)]), [*twist, rate])
    np.testing.assert_allclose(v, expected, atol=1e-7)
    if rate:
        np.testing.assert_allclose(arm.elbow(STATE) @ v, [-0.020383479, -0.037887441, -0.011625537], atol=1e-7)


@pytest.mark.parametrize(
    ("joint", "value"), [(3, 0.0), (1, HALF), (1, -HALF), (5, HALF), (5, -HALF)], ids=lambda v: f"{v:.2g}"
)
def test_ssrms_algorithmic_loci(joint: int, value: float) -> None:
    """(4.32), the branches that stand as printed; the thesis reports ranks 6 and 6 on them."""
    q = STATE.copy()
    q[joint] = value
    assert abs(ssrms().det(q)) < 1e-10
    assert rank(ssrms().xi(q)) == 6
    assert rank(ssrms().xi(q), ssrms().alpha(q)) == 6


def test_ssrms_folded_arm_switches_the_row_off() -> None:
    """q4 = pi: the pitch axes coincide, r = 0, alpha is undefined (a division by zero in the thesis)."""
    q = STATE.copy()
    q[3] = np.pi
    assert np.isfinite(ssrms().alpha(q)).all()
    assert ssrms().factor(q) == 0.0
    assert ssrms().factor(STATE) == 1.0


def fourth_branch(q3: float, q5: float, boom: float = 7.11, d: float = -0.7026) -> float:
    """(4.32) corrected: tan(q4/2) = -(2 L + D (s3 + s5)) / (D (c3 + c5)), in the form with atan2."""
    c3, s3, c5, s5 = np.cos(q3), np.sin(q3), np.cos(q5), np.sin(q5)
    first = -d * (c3 + c5) * (2 * boom + d * (s3 + s5))
    second = -(2 * boom * (boom + d * (s3 + s5)) + d**2 * (s3**2 - c5**2 + s3 * s5 - c3 * c5))
    return float(np.arctan2(first, second))


def test_ssrms_fourth_branch_corrected() -> None:
    q = STATE.copy()
    q[3] = fourth_branch(q[2], q[4])
    assert q[3] == pytest.approx(2.978321908, abs=1e-9)
    assert abs(ssrms().det(q)) < 1e-10
    assert smallest(ssrms().xi(q)) == pytest.approx(0.233673, abs=1e-6)
    for other in states(30, seed=7):
        other[3] = fourth_branch(other[2], other[4])
        half = -(2 * 7.11 - 0.7026 * (np.sin(other[2]) + np.sin(other[4])))
        half /= -0.7026 * (np.cos(other[2]) + np.cos(other[4]))
        assert np.tan(other[3] / 2) == pytest.approx(half, rel=1e-8)
        assert abs(ssrms().det(other)) < 1e-9


def test_ssrms_fourth_branch_as_printed_is_no_root() -> None:
    """(4.32) as printed (second argument of the opposite sign, D where D^2 is needed) gives q4 = 0.162021849 here."""
    q = STATE.copy()
    q[3] = 0.162021849
    assert ssrms().det(q) == pytest.approx(86.5680895, abs=1e-6)
    assert smallest(ssrms().xi(q), ssrms().alpha(q)) == pytest.approx(0.20961, abs=5e-6)
    # The sign alone is enough to miss the branch: it gives pi - q4
    q[3] = np.pi - fourth_branch(q[2], q[4])
    assert abs(ssrms().det(q)) > 50


# --- compact arm of the dexterous manipulator, section 4.4 -----------------------------------------


def spdm_det(q: np.ndarray, boom: float = 1.0, d: float = 0.2) -> float:
    c4 = np.cos(q[3])
    lead = np.cos(q[1]) * np.cos(q[5]) * boom**2 * np.sin(q[3])
    return float(lead * (2 * boom * (1 + c4) + d * (np.cos(q[4]) + np.cos(q[3] + q[4]))) / np.sqrt(2 * (1 + c4)))


def test_spdm_row_corrected() -> None:
    """(4.38): printed with c2 in the second entry as well and |r| with 1 - cos q4, which fails."""
    for q in states(50, seed=8):
        c4 = np.cos(q[3])
        first = np.cos(q[2]) + np.cos(q[2] + q[3])
        second = np.sin(q[2]) + np.sin(q[2] + q[3])
        want = np.array([np.cos(q[1]) * first, second, 0, 0, 0, 0, 0]) / np.sqrt(2 * (1 + c4))
        printed = np.cos(q[1]) * np.array([first, second]) / np.sqrt(2 * (1 - c4))
        np.testing.assert_allclose(spdm().alpha(q)[0], want, rtol=0, atol=1e-12)
        assert np.abs(spdm().alpha(q)[0, :2] - printed).max() > 1e-3


def test_spdm_determinant() -> None:
    assert spdm().det(STATE) == pytest.approx(1.207441981487824, rel=1e-12)
    for q in states(100, seed=9):
        assert spdm().det(q) == pytest.approx(spdm_det(q), abs=1e-11)


def test_spdm_loci() -> None:
    """(4.39): q4 in {0, pi}, q2, q6 = +-pi/2, and the closed-form branch, which stands as printed with L2 = D."""
    for joint, value in ((3, 0.0), (1, HALF), (1, -HALF), (5, HALF), (5, -HALF)):
        q = STATE.copy()
        q[joint] = value
        assert abs(spdm().det(q)) < 1e-12
        assert rank(spdm().xi(q)) == 6
    q, d = STATE.copy(), 0.2
    c5, s5 = np.cos(q[4]), np.sin(q[4])
    q[3] = np.arctan2(2 * d * s5 * (2 + d * c5), -(4 * (1 + d * c5) + d**2 * (c5**2 - s5**2)))
    assert q[3] == pytest.approx(3.022046029, abs=1e-9)
    assert abs(spdm().det(q)) < 1e-12
    assert smallest(spdm().xi(q)) == pytest.approx(0.083719, abs=1e-6)


def locks(*joints: int) -> np.ndarray:
    return np.eye(7)[list(joints)]


def test_spdm_plane_with_roll_locks_fails_only_at_a_straight_arm() -> None:
    """(4.41): rank{xi, alpha, q1, q7} = 6 at q4 = 0 (the elbow does not reach pi), 7 elsewhere."""
    for q in states(100, seed=10):
        assert rank(spdm().xi(q), spdm().alpha(q), locks(0, 6)) == 7
        q[3] = 0.0
        assert rank(spdm().xi(q), spdm().alpha(q), locks(0, 6)) == 6
        assert rank(spdm().xi(q), spdm().alpha(q)) == 6
        assert rank(spdm().xi(q), spdm().elbow(q)) == 7


@pytest.mark.parametrize("joint", [1, 5])
def test_spdm_roll_locks_cure_the_other_loci(joint: int) -> None:
    q = STATE.copy()
    q[joint] = HALF
    assert rank(spdm().xi(q), spdm().alpha(q)) == 6
    assert rank(spdm().xi(q), spdm().alpha(q), locks(0, 6)) == 7


def test_spdm_best_pair_stays_well_conditioned() -> None:
    """Best of {alpha, q1, q7, x4, y4, z4}: sigma_min never falls below 0.3 of the task's own (section 4.4)."""
    worst = np.inf
    for q in states(500, seed=11):
        task = spdm().xi(q)
        own = smallest(task)
        if own < 1e-3:
            continue
        extra = np.vstack([spdm().alpha(q), locks(0, 6), spdm().elbow(q)])
        stacked = np.stack([np.vstack([task, row]) for row in extra])
        worst = min(worst, np.linalg.svd(stacked, compute_uv=False)[:, -1].max() / own)
    assert worst > 0.3


# --- the manipulator on the Space Station arm, 22 joints, section 4.5 ------------------------------


def composite() -> Robot:
    """Two compact arms and a body joint on the tip of the Space Station arm."""
    model = pin.Model()
    last = models.add_chain(model, models.ssrms_links(**models.SSRMS_OFFSETS), "s_")
    body = pin.SE3(np.eye(3), np.array([models.SSRMS_OFFSETS["x7"], 0, 0]))
    for prefix, side in (("a_", 1.0), ("b_", -1.0)):
        mount = body * pin.SE3(pin.rpy.rpyToMatrix(0.3 * side, 0.2, 1.1 * side), np.array([0.4, 0.5 * side, 0.1]))
        models.add_chain(model, models.spdm_links(), prefix, last, mount)
    models.add_chain(model, [(models.Z, (0, 0, 0))], "body_", last, body)
    model.addFrame(pin.Frame("base", last, 0, body, pin.FrameType.OP_FRAME))
    return models.robot("composite", model)


def test_composite_determinant_factorises() -> None:
    """(4.48) with one alpha row an arm: the 22 x 22 determinant is the product of the three 7 x 7 ones."""
    robot = composite()
    names = list(robot.dof_names)
    columns = {p: [k for k, n in enumerate(names) if n.startswith(p)] for p in ("s_", "a_", "b_", "body_")}
    arms = {p: Arm(robot, prefix=p) for p in ("a_", "b_", "s_")}
    relative = Arm(robot, prefix="a_", base="base")
    for q in states(20, 22, seed=12):
        rows, single = [], 1.0
        for prefix, arm in arms.items():
            block = np.vstack([arm.xi(q), arm.alpha(q)])
            single *= float(np.linalg.det(block[:, columns[prefix]]))
            rows.append(block)
        brake = np.zeros((1, 22))
        brake[0, columns["body_"]] = 1.0
        matrix = np.vstack([*rows, brake])
        order = columns["a_"] + columns["b_"] + columns["s_"] + columns["body_"]
        assert np.linalg.det(matrix[:, order]) == pytest.approx(single, rel=1e-9)
        # Counted from its mounting, an arm's plane rate has nothing of the carrying arm, and is the lone arm's
        row = relative.alpha(q)[0]
        np.testing.assert_array_equal(np.delete(row, columns["a_"]), np.zeros(15))
        np.testing.assert_allclose(row[columns["a_"]], spdm().alpha(q[columns["a_"]])[0], atol=1e-12)
        np.testing.assert_allclose(arms["a_"].alpha(q)[0, columns["a_"]], row[columns["a_"]], atol=1e-12)
