"""How far a driven body may be from where its command has it."""

from __future__ import annotations

from math import radians

import numpy as np
import pinocchio as pin
import pytest

from wbc.walking.modes.steering import EASILY, SPEEDS, displaced, displacement, towards, undisplaced

INCH = 0.0254


def test_a_displacement_is_in_the_axes_of_the_body_and_its_way() -> None:
    pose = pin.SE3(pin.exp3(np.array([0.3, -0.2, 0.9])), np.array([1.0, 2.0, 3.0]))
    x, y, z = pose.rotation.T
    for way, ahead, left in (((0.2, 0.0), x, y), ((0.0, -0.1), -y, x), ((0.0, 0.0), x, y)):
        lower = displaced(pose.homogeneous, displacement(np.array(way), 2 * INCH, 0.0, 0.0, 0.0))
        assert lower[:3, 3] - pose.translation == pytest.approx(2 * INCH * z)
        aside = displaced(pose.homogeneous, displacement(np.array(way), 0.0, 2 * INCH, 0.0, 0.0))
        assert aside[:3, 3] - pose.translation == pytest.approx(2 * INCH * left)
        for k, axis in ((2, ahead), (3, left)):
            much = [0.0] * 4
            much[k] = radians(3.0)
            tilted = displaced(pose.homogeneous, displacement(np.array(way), *much))
            assert pin.log3(tilted[:3, :3] @ pose.rotation.T) == pytest.approx(radians(3.0) * axis)
            assert tilted[:3, 3] == pytest.approx(pose.translation)
    by = displacement(np.array([0.3, 0.4]), 0.03, -0.04, 0.02, 0.05)
    assert undisplaced(displaced(pose.homogeneous, by), by) == pytest.approx(pose.homogeneous)


def test_it_comes_and_goes_as_fast_and_as_gently_as_it_may() -> None:
    begin, rate = np.array([0.05, 0.0, 0.0, 0.0, -0.05]), np.array([0.05, 0.0, -0.03, 0.0, 0.0])
    wanted, spacing = np.array([0.0, -0.05, 0.02, 0.0, 0.0]), 0.05
    rows = towards(begin, rate, np.repeat(wanted[None], 80, axis=0), spacing)
    rates = np.diff(np.concatenate([(begin - rate * spacing)[None], begin[None], rows]), axis=0) / spacing
    assert (np.abs(rates) <= SPEEDS + 1e-12).all()
    assert (np.abs(np.diff(rates, axis=0)) <= EASILY * spacing + 1e-12).all()
    assert rows[-1] == pytest.approx(wanted, abs=1e-5)
    assert rates[-1] == pytest.approx(np.zeros(5), abs=1e-4)
