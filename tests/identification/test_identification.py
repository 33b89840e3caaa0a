"""Base parameters, exciting motions and fits: against Pinocchio's regressor, and on simulated robots."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from typer.testing import CliRunner

from tests.refusals import assert_refused
from wbc.cli.app import app
from wbc.errors import InfeasibleError, RangeError, ShapeError, UnsupportedJointError
from wbc.identification import Regression, Samples, base_parameters, exciting_motion, identifiable, identify
from wbc.identification.experiment import changed, experiment, filtered
from wbc.identification.information import Information
from wbc.identification.pseudo_inertia import is_body, model_parameters
from wbc.robot import Robot
from wbc.robots import load


def arm(gravity: float = 9.81, joints: int = 3, turned: int = 0) -> Robot:
    """Links of 1 kg with joints about y, z, y ... on a wall."""
    model = pin.Model()
    parent = 0
    for k in range(joints):
        joint = pin.JointModelRY() if (k + turned) % 2 == 0 else pin.JointModelRZ()
        place = pin.SE3(np.eye(3), np.array([0.3 * (k > 0), 0.0, 0.05]))
        parent = model.addJoint(parent, joint, place, f"joint{k}")
        at = pin.SE3(np.eye(3), np.array([0.15, 0.02, 0.0]))
        model.appendBodyToJoint(parent, pin.Inertia.FromBox(1.0, 0.3, 0.1, 0.08), at)
    model.gravity.linear = np.array([0.0, 0.0, -gravity])
    model.name = "arm"
    robot = load(model)
    limit = np.full(joints, 1.5)
    return robot.with_limits(position_lower=-limit, position_upper=limit, velocity=3.0, acceleration=20.0)


@pytest.fixture(scope="module")
def regression() -> Regression:
    return Regression(arm())


@pytest.mark.parametrize(("gravity", "joints", "turned"), [(9.81, 3, 0), (0.0, 3, 0), (9.81, 2, 1), (0.0, 4, 1)])
def test_the_count_is_the_rank_of_pinocchios_regressor(gravity: float, joints: int, turned: int) -> None:
    robot = arm(gravity, joints, turned)
    base, data, rng = identifiable(Regression(robot), 60), robot.model.createData(), np.random.default_rng(1)
    rows = [pin.computeJointTorqueRegressor(robot.model, data, *rng.normal(size=(3, joints))) for _ in range(60)]
    W = np.vstack(rows)
    assert base.count == np.linalg.matrix_rank(W, tol=1e-8 * np.linalg.norm(W))
    # Torques are those of the base parameters alone
    phi = rng.normal(size=10 * joints)
    np.testing.assert_allclose(W[:, list(base.columns)] @ (base.combination @ phi), W @ phi, atol=1e-8)
    # Gravity along the first axis says nothing, and the mass of the first link never does
    assert not base.shows(np.eye(10 * joints)[0])
    assert base.shows(base.combination[0])


def test_an_exciting_motion(regression: Regression) -> None:
    """Within its limits by its certificate, better than random ones, and all base parameters are shown."""
    found = exciting_motion(regression, tries=40)
    assert found.law.certificate.satisfied
    assert found.score > found.first + 1.0
    assert found.base.count == identifiable(regression).count
    assert found.base.condition < 30.0
    assert found.law.at(0.0).velocity == pytest.approx(0.0, abs=1e-9)


def test_weak_motors() -> None:
    """Torques of the motion are within the limits; where gravity alone is above, nothing is proposed."""
    robot = arm().with_limits(effort=[40.0, 15.0, 10.0])
    law = exciting_motion(Regression(robot), tries=5).law
    data = robot.model.createData()
    torques = [pin.rnea(robot.model, data, *law.at(t)) for t in np.linspace(0.0, law.duration, 60)]
    assert (np.abs(torques).max(axis=0) <= robot.limits.effort).all()
    weak = Regression(arm().with_limits(effort=0.1))
    assert_refused(lambda: exciting_motion(weak, tries=3), InfeasibleError, "limits of torque")


@pytest.mark.parametrize("friction", [False, True])
def test_a_fit_of_torques_with_noise(friction: bool) -> None:
    """Errors are those of the noise: about one standard deviation; every body is one; friction is found."""
    robot, rng, nv = arm(), np.random.default_rng(2), 3
    regression, true = Regression(robot, friction), changed(robot, 0.6)
    q, v, a = rng.uniform(-1.5, 1.5, (150, nv)), rng.normal(size=(150, nv)), 3.0 * rng.normal(size=(150, nv))
    data = true.model.createData()
    torque = np.array([pin.rnea(true.model, data, *state) for state in zip(q, v, a, strict=True)])
    if friction:
        torque += 0.4 * v + 0.2 * np.tanh(v / 0.05)
    found = identify(regression, Samples(q, v, a, torque + 0.02 * rng.normal(size=torque.shape)))
    truth = np.concatenate([model_parameters(true.model), [0.4] * nv, [0.2] * nv])[: len(found.parameters)]
    errors = (found.values - found.base.combination @ truth) / found.deviations
    assert np.sqrt((errors**2).mean()) < 1.5
    assert (found.residual < 0.025).all()
    assert (found.start > 5.0 * found.residual).all()
    assert all(is_body(np.array(body.toDynamicParameters())) for body in list(found.robot.model.inertias)[1:])
    if friction:
        np.testing.assert_allclose(np.concatenate(found.friction()), [0.4] * nv + [0.2] * nv, atol=0.03)


@pytest.mark.parametrize("seed", [12, 19, 41, 51])
def test_far_bodies_are_found(seed: int) -> None:
    """Without noise the fit explains torques of a motion that it has not seen, however far the bodies were."""
    random, model = np.random.default_rng(seed), arm().model
    joint = random.choice([pin.JointModelPY(), pin.JointModelRX()])
    model.addJoint(3, joint, pin.SE3(pin.exp6(random.normal(size=6))), "tool")
    for k in range(1, 5):
        place = pin.SE3(pin.exp6(0.3 * random.normal(size=6)))
        model.inertias[k] = place.act(pin.Inertia.FromBox(random.uniform(0.3, 5.0), *random.uniform(0.05, 0.5, 3)))
    robot = load(model)
    true = changed(robot, 1.5, seed).model
    data = true.createData()

    def samples(count: int) -> Samples:
        states = random.normal(size=(3, count, 4))
        torques = [pin.rnea(true, data, *state) for state in states.transpose(1, 0, 2)]
        return Samples(*states, np.array(torques))

    regression, unseen = Regression(robot), samples(30)
    W, y = regression.stacked(unseen)
    found = identify(regression, samples(100))
    np.testing.assert_allclose(W @ found.parameters, y, atol=1e-6 * np.abs(y).max())


def test_few_and_noisy_samples_still_give_bodies() -> None:
    """Plain least squares gives masses below 0 there."""
    robot, rng = arm(), np.random.default_rng(3)
    regression = Regression(robot)
    q, v, a = 0.2 * rng.normal(size=(3, 12, 3))
    samples = Samples(q, v, a, rng.normal(size=(12, 3)))
    W, y = regression.stacked(samples)
    plain = np.linalg.lstsq(W, y, rcond=None)[0]
    assert not all(is_body(plain[k : k + 10]) for k in (0, 10, 20))
    found = identify(regression, samples)
    assert all(is_body(found.parameters[k : k + 10]) for k in (0, 10, 20))


def test_information() -> None:
    """The deviation is that of least squares; what is not shown is infinite and never claimed."""
    rng = np.random.default_rng(4)
    Y = rng.normal(size=(50, 4)) * [1.0, 10.0, 0.1, 0.0]
    Y[:, 2] = Y[:, 0]
    known = Information(4, 0.5)
    for row in Y:
        known.add(row[None], 0.01)
    exact = 0.5 * np.sqrt(np.linalg.inv(0.01 * Y[:, :2].T @ Y[:, :2])[1, 1])
    assert known.deviation(np.eye(4)[1]) == pytest.approx(exact)
    assert known.claims(np.eye(4)[1], 3.0 * exact)
    assert not known.claims(np.eye(4)[1], 1.5 * exact)
    assert np.isinf(known.deviation(np.eye(4)[0]))
    assert np.isinf(known.deviation(np.eye(4)[3]))
    # Columns 0 and 2 are one: their sum is known
    assert np.isfinite(known.deviation(np.array([1.0, 0.0, 1.0, 0.0])))


def test_the_filter_has_no_delay() -> None:
    dt = 0.002
    t = np.arange(0.0, 4.0, dt)
    samples = filtered(np.sin(2.0 * t)[:, None], np.cos(3.0 * t)[:, None], dt)
    here = t[150 : len(t) - 150 : 31][: len(samples.q)]
    np.testing.assert_allclose(samples.q[:, 0], np.sin(2.0 * here), atol=1e-3)
    np.testing.assert_allclose(samples.a[:, 0], -4.0 * np.sin(2.0 * here), atol=0.02)
    np.testing.assert_allclose(samples.torque[:, 0], np.cos(3.0 * here), atol=1e-3)


def test_a_simulated_robot_from_beginning_to_end() -> None:
    """On a motion that was not seen torques that the fit does not explain are 5 times less than the model's."""
    done = experiment(arm(joints=2, turned=0), far=0.4, tries=3, noise=1e-5, waypoints=4)
    assert (done.check[0] < 0.2 * done.check[1]).all()
    assert np.sqrt((done.errors**2).mean()) < 2.5


def test_what_is_refused(regression: Regression) -> None:
    none = np.zeros((4, 3))
    assert_refused(lambda: identify(regression, Samples(none, none, none[:, :2], none)), ShapeError, "a")
    assert_refused(lambda: identify(regression, Samples(none, none, none, none), noise=0.0), RangeError, "noise")
    with pytest.raises(ShapeError):
        base_parameters(np.zeros((3, 3)))
    still = Regression(arm(0.0))
    assert_refused(lambda: identify(still, Samples(none, none, none, none)), InfeasibleError, "no torque")
    with pytest.raises(UnsupportedJointError):
        exciting_motion(Regression(load(arm().model, base="floating")), tries=1)
    with pytest.raises(RangeError):
        experiment(arm(), noise=-1.0)


def test_command(tmp_path: Path) -> None:
    """It prints what was found and writes law, plot and figures; a robot on a moving base is refused in one line."""
    run = CliRunner().invoke(app, ["dynamics", "identify", "double_pendulum", "--tries", "5", "--out", str(tmp_path)])
    assert run.exit_code == 0, run.output
    assert "parameters can be known" in run.output
    assert {"identified.json", "motion.npz", "motion.png"} <= {file.name for file in tmp_path.iterdir()}
    wrong = CliRunner().invoke(app, ["dynamics", "identify", "solo12", "--out", str(tmp_path / "b")])
    assert wrong.exit_code == 2
