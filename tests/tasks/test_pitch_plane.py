"""The angle of an arm's plane, from points and from an axis, and its rate."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest

from tests.refusals import assert_refused
from tests.tasks.planes import (
    CASES,
    OFFSET,
    PANDA,
    TALOS,
    TILTED,
    angle_differs,
    clear,
    compiled,
    evaluate,
    robot,
    seen,
)
from wbc.errors import RangeError, UnknownNameError
from wbc.tasks._stereographic import PlaneReference
from wbc.tasks.pitch_plane import PitchPlane


@pytest.mark.parametrize("case", CASES)
def test_angle_is_that_of_pinocchio(case: str) -> None:
    name, item = CASES[case]
    assert angle_differs(name, item) < 1e-11
    q = clear(name, item, 1, seed=2)[0]
    assert item.angle(robot(name), q) == pytest.approx(seen(name, item, q).psi, abs=1e-12)
    assert item.initial(robot(name), q) == {"target": item.angle(robot(name), q)}


def test_angle_in_a_moving_base_ignores_the_base() -> None:
    """Seen from the torso, neither the floating base nor the other joints turn the plane."""
    arm = [k for k, n in enumerate(robot("talos").dof_names) if n.startswith("arm_left")]
    for q in clear("talos", TALOS, 5, seed=4):
        rest = np.delete(evaluate("talos", TALOS, q)[1], arm)
        assert np.abs(rest).max() < 1e-12
    rate = replace(TALOS, axis="arm_left_4_joint")
    for q in clear("talos", rate, 5, seed=4):
        np.testing.assert_array_equal(np.delete(evaluate("talos", rate, q)[1], arm), np.zeros(len(q) - 1 - len(arm)))


@pytest.mark.parametrize(
    ("name", "item"),
    [
        ("panda", replace(PANDA, axis="panda_joint4")),
        ("ssrms", replace(OFFSET, axis="joint3")),
        ("ssrms", replace(OFFSET, axis="joint3", base="F1")),
    ],
    ids=str,
)
def test_angle_rate_is_alpha_and_the_transport_of_the_reference(name: str, item: PitchPlane) -> None:
    """d psi / dt = alpha + p.(u x du/dt) / (1 + p.u)."""
    model, step = robot(name).model, 1e-6
    angled = replace(item, reference=TILTED)
    pole = np.array(TILTED.pole)
    for q, v in zip(clear(name, angled, 10, seed=9), np.random.default_rng(9).normal(size=(10, model.nv)), strict=True):
        line = seen(name, angled, q).line
        ahead = seen(name, angled, pin.integrate(model, q, step * v)).line
        behind = seen(name, angled, pin.integrate(model, q, -step * v)).line
        transport = pole @ np.cross(line, ahead - behind) / (2 * step) / (1 + pole @ line)
        alpha = (evaluate(name, item, q)[1] @ v).item()
        psi = (evaluate(name, angled, q)[1] @ v).item()
        assert psi == pytest.approx(alpha + transport, abs=1e-7)


def test_rate_form_counts_from_the_present_plane() -> None:
    item = replace(OFFSET, axis="joint3")
    assert item.commands_rate
    target, feedforward = item.inputs(robot("ssrms"))
    assert (target.default, target.rate, feedforward.default) == (0.0, "feedforward", 0.0)
    assert item.initial(robot("ssrms"), np.zeros(7)) == {}
    for q in clear("ssrms", item, 3):
        value, _, _, drift = compiled("ssrms", item)(q, 0.25)
        assert float(value) == -0.25
        assert float(drift) == -1.0


def test_axes_that_turn_no_plane_are_refused() -> None:
    assert_refused(lambda: replace(TALOS, axis="root_joint").validate(robot("talos")), UnknownNameError, "axis")
    ssrms = replace(OFFSET, axis="joint3", base="F2")
    assert_refused(lambda: ssrms.validate(robot("ssrms")), RangeError, "axis")


def test_plain_numbers_are_welcome() -> None:
    item = replace(PANDA, elbow_offset=np.array([0, 0, 1], dtype=np.float32), reference_width=1)
    assert item.elbow_offset == (0.0, 0.0, 1.0)
    assert hash(item) == hash(replace(item))
    assert PlaneReference(pole=[0, 0, 5], direction=[3, 0, 1]) == PlaneReference()
