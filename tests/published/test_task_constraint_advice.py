"""Which pair where: E. Dupuis, "A General Framework for the Manual Teleoperation of Kinematically Redundant Space-Based
Manipulators", PhD thesis, McGill University, 2001, eqs. 4.2 to 4.11 and section 4.5. Numbers are of its formulas.
"""

from __future__ import annotations

from math import pi

import numpy as np
import pytest

from wbc.coordinates import Adviser, Conditioning, CoordinatePair, parts

FOUR = parts("spherical_4r").arms[0]


def test_a12_advice_along_the_second_joint_of_the_spherical_shoulder() -> None:
    assert FOUR.alpha is not None
    assert FOUR.middle is not None
    (beta,), robot = FOUR.in_plane, parts("spherical_4r").robot
    pairs = [CoordinatePair(FOUR.tip, FOUR.alpha, "alpha"), CoordinatePair(FOUR.tip, beta, "beta")]
    adviser = Adviser(robot, pairs, length=1.0, backend="vm")
    for q2, first, second, best in (
        (0.0, 0.424124, 0.0, "alpha"),
        (0.5, 0.421499, 0.390733, "alpha"),
        (1.2, 0.261023, 0.414274, "beta"),
        (1.5, 0.050729, 0.414638, "beta"),
        (pi / 2, 0.0, 0.414650, "beta"),
    ):
        q = np.array([0.3, q2, -0.7, 1.1])
        np.testing.assert_allclose(adviser.sigmas(q), (first, second), atol=5e-6)
        assert adviser.recommend(q) == best
    rows = [(FOUR.tip,), (FOUR.tip, FOUR.alpha), (FOUR.tip, FOUR.middle), (FOUR.tip, beta)]
    ranks = [np.linalg.matrix_rank(J, 1e-9) for J in Conditioning(robot, rows, backend="vm").matrices(q)]
    assert ranks == [3, 3, 3, 4]


@pytest.mark.parametrize(
    ("name", "held", "least", "seen"),
    [
        ("spdm_arm_simplified", ("alpha", "joint1", "joint7", "elbow x", "elbow y", "elbow z"), 0.3, 0.4727),
        ("spdm_arm", ("alpha", "joint1", "joint7", "elbow x", "elbow y", "elbow z"), 0.3, 0.3426),
        ("ssrms", ("beta", "gamma", "elbow x", "elbow y", "elbow z"), 0.1, 0.1260),
    ],
)
def test_a23_the_best_pair_keeps_what_the_task_has(name: str, held: tuple[str, ...], least: float, seen: float) -> None:
    """Over 10^4 configurations; rows in metres and radians."""
    arm = parts(name).arms[0]
    groups = [(arm.tip,), *((arm.tip, one) for one in arm.candidates() if str(one) in held)]
    assert len(groups) == 1 + len(held)
    made, worst = Conditioning(parts(name).robot, groups, length=1.0), np.inf
    for q in np.random.default_rng(7).uniform(-pi, pi, (10_000, 7)):
        task, *every = made.sigmas(q)
        worst = min(worst, max(every) / task) if task > 1e-3 else worst
    assert worst > least
    assert worst == pytest.approx(seen, abs=1e-3)


def test_a14_loci_of_the_spherical_shoulder() -> None:
    """Ranks on the loci of (4.2) to (4.11), (4.10) as corrected; searches from random starts find no others."""
    assert FOUR.alpha is not None
    assert FOUR.middle is not None
    (beta,), robot = FOUR.in_plane, parts("spherical_4r").robot
    sets = {
        "task": (FOUR.tip,),
        "elbow": (FOUR.tip, FOUR.middle),
        "alpha": (FOUR.tip, FOUR.alpha),
        "alpha, beta": (FOUR.tip, FOUR.alpha, beta),
        "elbow, beta": (FOUR.tip, FOUR.middle, beta),
    }
    made = Conditioning(robot, list(sets.values()), length=1.0)
    # tan q3 of the second branch of (4.2): L3 c3 + L4 c34 = 0 at q4 = 1.1
    across = np.arctan2(1.0 + 0.8 * np.cos(1.1), 0.8 * np.sin(1.1))
    for q, wanted in (
        ((0.3, 0.5, -0.7, 0.0), (2, 3, 3, 3, 4)),
        ((0.3, 0.5, -0.7, pi), (2, 3, None, None, 4)),
        ((0.3, pi / 2, -0.7, 1.1), (3, 3, 3, 4, 4)),
        ((0.3, -pi / 2, across, 1.1), (2, 3, 3, 4, 4)),
        ((0.3, 0.0, -0.7, 0.0), (2, 3, 3, 3, 3)),
        ((0.3, 0.5, pi / 2, 0.0), (2, 3, 3, 3, 3)),
        ((0.3, 0.5, -0.7, 1.1), (3, 4, 4, 4, 4)),
    ):
        ranks = [np.linalg.matrix_rank(J, 1e-9 * np.linalg.norm(J)) for J in made.matrices(np.array(q))]
        assert [a for a, b in zip(ranks, wanted, strict=True) if b is not None] == [b for b in wanted if b is not None]
    folded = [np.linalg.svd(J, compute_uv=False)[-1] for J in made.matrices(np.array([0.3, 0.5, -0.7, 1.1]))]
    assert min(folded) > 0.1
    for start in np.random.default_rng(3).uniform(-pi, pi, (20, 4)):
        for k, name in enumerate(sets):
            q = start.copy()
            for _ in range(40):
                sigma, slopes, _ = made.slopes(q)
                steep = float(slopes[k] @ slopes[k])
                if sigma[k] < 1e-9 or steep < 1e-12:
                    break
                step = -sigma[k] / steep * slopes[k]
                q = q + step * min(1.0, 0.3 / float(np.linalg.norm(step)))
            if sigma[k] >= 1e-9:
                continue
            flat = abs(np.sin(q[3])) < 1e-4
            upright, reach = abs(np.cos(q[1])) < 1e-4, abs(np.cos(q[2]) + 0.8 * np.cos(q[2] + q[3])) < 1e-4
            both = flat and (abs(np.sin(q[1])) < 1e-4 or abs(np.cos(q[2])) < 1e-4)
            known = {"task": flat or (upright and reach), "alpha, beta": flat, "elbow, beta": both}
            assert known.get(name, flat or upright), (name, q)
