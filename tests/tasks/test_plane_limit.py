"""Limits of the angle of an arm's plane: margins and their derivatives."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.tasks.planes import (
    LIMIT,
    clear,
    evaluate,
    robot,
    seen,
    states,
    wrap,
)
from wbc.tasks.pitch_plane_limit import PitchPlaneLimit

LIMITS: dict[str, tuple[str, PitchPlaneLimit]] = {
    "panda": ("panda", PitchPlaneLimit("panda_link2", "panda_link4", "panda_link6", lower=-1.0, upper=0.2)),
    "spherical": ("spherical", LIMIT),
    "range across pi": ("spherical", replace(LIMIT, lower=2.5, upper=4.0)),
    "axis": ("ssrms", PitchPlaneLimit("F3", "F4", "F5", axis="joint3", lower=-1.0, upper=1.0)),
}


@pytest.mark.parametrize("case", LIMITS)
def test_margins_are_the_distances_to_the_bounds(case: str) -> None:
    name, item = LIMITS[case]
    for q in clear(name, item, 20, seed=14):
        middle, half = (item.lower + item.upper) / 2, (item.upper - item.lower) / 2
        off = wrap(seen(name, item, q).psi - middle)
        np.testing.assert_allclose(evaluate(name, item, q)[0], [half + off, half - off], atol=1e-11)


@pytest.mark.parametrize("case", LIMITS)
def test_margin_derivative_includes_the_fading(case: str) -> None:
    """Central differences of the margins themselves, at random states and inside the faded zones."""
    name, item = LIMITS[case]
    model = robot(name).model
    states_here = list(states(name, 10, seed=15))
    if name == "spherical":
        states_here += [np.array([0.3, 0.9, 0.2, bend, 0.4, 0.5, 0.6]) for bend in (0.05, 0.1, 0.15, 0.2)]
        assert 0.0 < evaluate(name, item, states_here[-2])[2][0] < 1.0
    for q in states_here:
        jacobian = evaluate(name, item, q)[1]
        for k, direction in enumerate(1e-6 * np.eye(model.nv)):
            change = evaluate(name, item, q + direction)[0] - evaluate(name, item, q - direction)[0]
            np.testing.assert_allclose(jacobian[:, k], change / 2e-6, atol=1e-6 * (1 + np.abs(jacobian).max() ** 2))
