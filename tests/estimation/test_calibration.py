"""Calibration of a device: exact data give it back, noise gives the spread that the covariance says, and data that
cannot tell are refused. The printed tables of a measurement arm: a scale and two tilts.
"""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

from wbc.errors import ShapeError, SolverError
from wbc.estimation import calibrate

TIMES = np.arange(0.0, 20.0, 0.1)
#: Where a table was moved along x and along y [in], and what the arm read, tables 4.1 and 4.2 (Hirabayashi 1981)
MOVED = np.concatenate([np.outer(range(6), (1, 0, 0)), np.outer(range(6), (0, 1, 0))]).astype(float)
READ = np.array(
    [
        (0, 0, 0), (1.04, -0.06, 0.07), (2.02, -0.07, 0.14), (2.90, 0, 0.21), (3.82, 0.03, 0.25), (4.78, 0.11, 0.30),
        (0, 0, 0), (-0.03, 0.92, 0.04), (0, 1.91, 0.07), (0.05, 2.95, 0.09), (0.09, 4.0, 0.10), (0.10, 4.94, 0.10),
    ]
)  # fmt: skip


def path(t: np.ndarray) -> np.ndarray:
    return np.column_stack([0.4 * np.sin(0.9 * t), 0.3 * np.sin(1.3 * t + 1.0), 0.2 * np.cos(0.7 * t)])


def device(kind: str, seed: int) -> tuple[np.ndarray, np.ndarray, float]:
    rng = np.random.default_rng(seed)
    turn = pin.exp3(rng.uniform(-1.0, 1.0, 3))
    matrix = {"rigid": turn, "similarity": 0.946 * turn, "affine": turn + 0.06 * rng.uniform(-1.0, 1.0, (3, 3))}[kind]
    return matrix, rng.uniform(-1.0, 1.0, 3), float(rng.uniform(0.0, 0.08))


@pytest.mark.parametrize("kind", ["rigid", "similarity", "affine"])
def test_exact_readings_give_the_device_back(kind: str) -> None:
    for seed, more in ((0, 0.0), (1, 0.0), (2, 0.0), (3, 1.8), (4, -1.5)):
        matrix, offset, late = device(kind, seed)
        late += more
        found = calibrate(TIMES, path(TIMES - late) @ matrix.T + offset, path(TIMES), kind)  # type: ignore[arg-type]
        # What is left is that of the spline at both ends
        assert np.abs(found.matrix - matrix).max() < 1e-5
        assert np.abs(found.offset - offset).max() < 1e-5
        assert abs(found.delay - late) < 1e-5
        reading = path(TIMES[:5]) @ matrix.T + offset
        assert np.allclose(found.position(reading), path(TIMES[:5]), atol=1e-5)


def test_the_covariance_is_the_spread_over_many_calibrations() -> None:
    matrix, offset, late = device("similarity", 7)
    rng, clean = np.random.default_rng(0), path(TIMES - late) @ matrix.T + offset
    runs = [
        calibrate(TIMES, clean + 0.002 * rng.normal(size=clean.shape), path(TIMES), "similarity") for _ in range(60)
    ]
    declared = np.sqrt(np.diag(np.mean([run.covariance for run in runs], axis=0)))
    turns = np.array([pin.log3(run.rotation @ (matrix / 0.946).T) for run in runs])
    found = np.column_stack(
        [turns, np.log([run.scales.mean() / 0.946 for run in runs]), [r.offset for r in runs], [r.delay for r in runs]]
    ).std(axis=0)
    assert (np.abs(found / declared - 1.0) < 0.35).all()
    assert np.allclose([run.residual.mean() for run in runs], 0.002, rtol=0.1)
    assert runs[0].deviation("delay") == pytest.approx(declared[-1], rel=0.2)


def test_motion_that_tells_too_little_is_refused_by_the_name_of_what_it_cannot_tell() -> None:
    x = path(TIMES)
    flat, line = x * (1, 1, 0), np.outer(x[:, 0], (1, 2, 3))
    for kind, moved, blind in (("affine", flat, "M .z"), ("rigid", line, "turn"), ("similarity", 0 * x, "turn")):
        with pytest.raises(SolverError, match=blind):
            calibrate(TIMES, moved, moved, kind, delay=False)  # type: ignore[arg-type]
    steady = np.column_stack([0.1 * TIMES, 0.02 * TIMES, 0.0 * TIMES]) + 0.5
    with pytest.raises(SolverError, match=r"delay|offset|turn"):
        calibrate(TIMES, steady, steady, "rigid")
    with pytest.raises(ShapeError, match="readings"):
        calibrate(TIMES, x[:-1], x)


def test_the_printed_tables_have_a_short_scale_and_tilted_axes_and_say_nothing_of_z() -> None:
    times = np.arange(12.0)
    with pytest.raises(SolverError, match=r"M .z"):
        calibrate(times, READ, MOVED, "affine", delay=False)
    # A third axis that is square to both, as if it had been moved as well
    up = np.outer(range(6), (0, 0, 1))
    found = calibrate(np.arange(18.0), np.vstack([READ, up]), np.vstack([MOVED, up]), "affine", delay=False)
    assert np.allclose(found.tilts[:2], np.radians([3.45, 1.15]), atol=np.radians(0.8))
    assert 0.94 < found.scales[0] < 0.97
    assert 0.98 < found.scales[1] < 1.01
    corrected = found.position(READ) - MOVED
    assert np.abs(corrected).max() < 0.16 < np.abs(READ - MOVED).max()
