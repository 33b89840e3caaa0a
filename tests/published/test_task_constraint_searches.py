"""Searches for lost rank from random starts: E. Dupuis, "A General Framework for the Manual Teleoperation of
Kinematically Redundant Space-Based Manipulators", PhD thesis, McGill University, 2001, eqs. 4.22, 4.33 and 4.42. That a
search finds nothing else is evidence; the proof is the exact analysis beside it (test_rank_analysis.py).
"""

from __future__ import annotations

from math import pi

import numpy as np
import pytest
from scipy.optimize import OptimizeResult, minimize

from wbc.coordinates import Conditioning, Coordinate, parts

#: A search whose slope is larger has not ended at a least value
SLOPE = 1e-3


def search(name: str, rows: tuple[Coordinate, ...], starts: int) -> tuple[np.ndarray, np.ndarray]:
    """(least sigma_min of each search, where it is) of quasi-Newton descents on sigma_min^2 from random starts."""
    made = Conditioning(parts(name).robot, [rows], length=1.0)

    def square(q: np.ndarray) -> tuple[float, np.ndarray]:
        sigma, slopes, _ = made.slopes(q)
        return float(sigma[0]) ** 2, 2.0 * sigma[0] * slopes[0]

    def descent(q: np.ndarray) -> OptimizeResult:
        """Where two singular values meet the slope has a kink, at which a line search can end: on from beside it."""
        found = minimize(square, q, jac=True, method="BFGS", options={"gtol": 1e-11})
        for _ in range(3):
            if np.linalg.norm(found.jac) < SLOPE:
                break
            found = minimize(square, found.x + 1e-3, jac=True, method="BFGS", options={"gtol": 1e-11})
        return found

    found = [descent(q) for q in np.random.default_rng(3).uniform(-pi, pi, (starts, 7))]
    return np.sqrt([f.fun for f in found]), np.array([f.x for f in found])


@pytest.mark.parametrize("name", ["ssrms_simplified", "ssrms"])
def test_zeros_of_pose_elbow_beta_gamma(name: str) -> None:
    """A16, A21: every one of 150 searches ends in a zero, and every zero is one of (4.22), or of (4.33)."""
    arm = parts(name).arms[0]
    assert arm.middle is not None
    least, places = search(name, (arm.tip, arm.middle, *arm.in_plane), 150)
    assert least.max() < 1e-8
    s, c = np.abs(np.sin(places)), np.abs(np.cos(places))
    if name == "ssrms":
        off = np.array([s[:, 3], c[:, 2], c[:, 4]])
    else:
        off = np.array([s[:, 3], np.minimum(s[:, 1], c[:, 2]), np.minimum(s[:, 5], c[:, 4])])
    assert off.max() < 1e-3


def test_pose_both_rolls_alpha_and_elbow_of_the_dexterous_arm_have_no_zero() -> None:
    """A23: 40 searches on {xi, alpha, q1, q7, elbow} end at 0.049 and above."""
    arm = parts("spdm_arm_simplified").arms[0]
    assert arm.middle is not None
    held = [one for one in arm.candidates() if str(one) in ("alpha", "joint1", "joint7")]
    least, _ = search("spdm_arm_simplified", (arm.tip, *held, arm.middle), 40)
    assert least.min() == pytest.approx(0.0490, abs=1e-3)
