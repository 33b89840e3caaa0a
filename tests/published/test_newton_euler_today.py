"""Today's controllers on the published task, with a payload that nobody knows of."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from typer.testing import CliRunner

from tests.published.newton_euler_arm import ARM, TASK, random_arm
from wbc.cli.app import app
from wbc.errors import RangeError, UnknownNameError
from wbc.published.newton_euler.comparison import compare, loaded
from wbc.published.newton_euler.today import SlotineLi, physical


@pytest.mark.parametrize("n", [1, 2, 4])
def test_regressor_of_two_velocities(n: int) -> None:
    """Y theta is M a + C(q, v) w + g; with C by Christoffel's symbols M' - 2 C is skew."""
    rng = np.random.default_rng(n)
    model = random_arm(rng, n).model
    data, h = model.createData(), 1e-6
    law = SlotineLi(model, TASK, 0.01, stiffness=1.0, damping=np.ones(n), rate=np.ones(10))
    for q, v, w, a in rng.normal(size=(5, 4, n)):
        wanted = pin.crba(model, data, q) @ a + pin.computeGeneralizedGravity(model, data, q)
        none = 0.0 * v
        gravity = law.regressor(q, none, none, none) @ law.known
        C = np.column_stack([law.regressor(q, v, e, none) @ law.known - gravity for e in np.eye(n)])
        scale = 1.0 + np.abs(C).max()
        np.testing.assert_allclose(law.regressor(q, v, w, a) @ law.known, wanted + C @ w, atol=1e-11 * scale)
        np.testing.assert_allclose(C @ v, pin.computeCoriolisMatrix(model, data, q, v) @ v, atol=1e-11 * scale)
        rate = (np.array(pin.crba(model, data, q + h * v)) - np.array(pin.crba(model, data, q - h * v))) / (2 * h)
        skew = rate - 2.0 * C
        np.testing.assert_allclose(skew, -skew.T, atol=1e-7 * scale)


def test_estimates_are_those_of_a_body() -> None:
    """What is no body goes to one; a body stays."""
    rng = np.random.default_rng(0)
    for _ in range(20):
        sides = rng.uniform(0.1, 1.0, 3)
        turned = pin.SE3.Random().rotation
        inertia = turned @ np.diag(sides.sum() - sides) @ turned.T
        body = np.array(pin.Inertia(rng.uniform(0.1, 5.0), rng.normal(size=3), inertia).toDynamicParameters())
        np.testing.assert_array_equal(physical(body), body)
        found = physical(rng.normal(size=10))
        assert found[0] >= 0.0
        # No negative eigenvalue left: a second projection changes nothing
        np.testing.assert_allclose(physical(found), found, atol=1e-12)
        xx, xy, yy, xz, yz, zz = found[4:]
        moments = np.linalg.eigvalsh([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        assert moments[2] <= moments[:2].sum() + 1e-9


def test_half_the_mass_of_the_last_link_unknown() -> None:
    """After 1 s the adaptive law is 10 times closer than computed torque, and under 1 mm, at 100 Hz already."""
    found = {one.name: one for one in compare(2.125, 0.01, ("computed torque", "Slotine and Li", "1 linearised"))}
    assert found["Slotine and Li"].tip[-1] < min(1e-3, 0.1 * found["computed torque"].tip[-1])
    assert found["Slotine and Li"].mass == pytest.approx(2.125, rel=0.05)
    assert found["computed torque"].tip.max() == pytest.approx(1.96e-3, rel=0.02)
    assert found["1 linearised"].tip.max() == pytest.approx(39.8e-3, rel=0.02)


def test_3_kg_at_1_khz() -> None:
    """The residual is under 0.3 of computed torque's, and the mass within 1 %."""
    computed, adaptive = compare(3.0, 0.001, ("computed torque", "Slotine and Li"))
    assert adaptive.tip[-1] < 0.3 * computed.tip[-1]
    assert adaptive.mass == pytest.approx(3.0, rel=0.01)


def test_loaded_arm() -> None:
    """A payload weighs on joint 3 along its rail."""
    q = np.array([0.3, 0.7, 0.45])
    torques = [pin.computeGeneralizedGravity(m, m.createData(), q) for m in (loaded(2.0), ARM.model)]
    assert (torques[0] - torques[1])[2] == pytest.approx(2.0 * ARM.gravity * np.cos(0.7))
    assert (torques[0] - torques[1])[1] == pytest.approx(-2.0 * ARM.gravity * 0.45 * np.sin(0.7))


def test_bad_input_of_the_comparison() -> None:
    with pytest.raises(UnknownNameError):
        list(compare(0.0, 0.01, ("Slotine",)))
    for payload, dt in ((-1.0, 0.01), (0.0, 0.0), (0.0, 0.003)):
        with pytest.raises(RangeError):
            list(compare(payload, dt))
    with pytest.raises(RangeError):
        SlotineLi(ARM.model, TASK, 0.01, stiffness=1.0, damping=np.zeros(3), rate=np.ones(10))


def test_command(tmp_path: Path) -> None:
    """It prints a row a controller and writes plot and figures; what it cannot do is said in one line."""
    run = CliRunner().invoke(
        app, ["compare-controllers", "--only", "computed torque", "--only", "2 on all joints", "--out", str(tmp_path)]
    )
    assert run.exit_code == 0, run.output
    assert "computed torque" in run.output
    assert (tmp_path / "controllers.json").is_file()
    assert (tmp_path / "controllers.png").stat().st_size > 10_000
    again = CliRunner().invoke(app, ["compare-controllers", "--out", str(tmp_path)])
    assert again.exit_code == 2
    wrong = CliRunner().invoke(app, ["compare-controllers", "--only", "computed", "--out", str(tmp_path / "b")])
    assert wrong.exit_code == 2
