"""Every joint type in a chain with itself, against Pinocchio, armature included."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pinocchio as pin
import pytest

from tests.symbolic.chains import KINDS, SLANTED, VARYING, chain, unaligned_unbounded
from tests.symbolic.referee import DESCRIPTIONS, REFERENCES, TOLERANCE, Comparison, distance, load, random_state
from wbc.errors import UnknownNameError, UnsupportedJointError
from wbc.robot import Limits, Robot
from wbc.symbolic import Centroidal, Dynamics, Kinematics, Velocities
from wbc.symbolic.kinematics import frame_index

BOX = pin.Inertia(2.0, np.array([0.1, 0.2, 0.3]), np.diag([0.1, 0.2, 0.25]))


@pytest.mark.parametrize("kind", KINDS)
def test_joint_type(kind: str) -> None:
    comparison = Comparison(chain([KINDS[kind](), pin.JointModelRX(), KINDS[kind]()]), kind)
    comparison.poses()
    comparison.frame_motion(constant_subspaces=kind not in VARYING)
    comparison.center()
    comparison.forces()
    comparison.manifold()
    if kind not in VARYING:
        comparison.torque_derivatives(full=True)
    comparison.check()


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("reference", REFERENCES)
def test_jacobian_drift_is_the_rate_of_the_jacobian(kind: str, reference: str) -> None:
    """dJ/dt v against central differences of Pinocchio's J v along q (+) t v, step 1e-6."""
    model = chain([pin.JointModelRX(), KINDS[kind]()])
    data, (q, v, _) = model.createData(), random_state(model, kind)
    motion = Velocities(Kinematics(model))
    kin, tip = motion.kinematics, model.getFrameId("tip")
    ours = ca.Function("f", [kin.q, kin.v], [motion.jacobian_drift("tip", reference)])(q, v).full().ravel()
    ends = []
    for h in (1e-6, -1e-6):
        moved = pin.integrate(model, q, h * v)
        ends.append(pin.computeFrameJacobian(model, data, moved, tip, REFERENCES[reference]) @ v)
    assert distance(ours, (ends[0] - ends[1]) / 2e-6) < 1e-7


@pytest.mark.parametrize("kind", sorted(VARYING))
def test_torque_derivatives_where_the_subspace_varies(kind: str) -> None:
    """Against central differences of pin.rnea on the manifold, step 1e-6: about 1e-8 of rounding and truncation."""
    model = chain([pin.JointModelRX(), KINDS[kind]()])
    data, (q, v, a) = model.createData(), random_state(model, kind)
    dynamics = Dynamics(Kinematics(model))
    kin = dynamics.kinematics
    function = ca.Function("f", [kin.q, kin.v, dynamics.a], list(dynamics.inverse_dynamics_derivatives))
    by_q, by_v = (m.full() for m in function(q, v, a))

    def column(unit: np.ndarray, along_q: bool) -> np.ndarray:
        ends = []
        for h in (1e-6, -1e-6):
            moved = pin.integrate(model, q, h * unit) if along_q else q
            ends.append(pin.rnea(model, data, moved, v if along_q else v + h * unit, a).copy())
        return (ends[0] - ends[1]) / 2e-6

    units = np.eye(model.nv)
    assert distance(by_q, np.array([column(u, True) for u in units]).T) < 1e-7
    assert distance(by_v, np.array([column(u, False) for u in units]).T) < 1e-7


def test_continuous_joint_about_a_slanted_axis() -> None:
    model = unaligned_unbounded()
    assert model.joints[1].shortname() == "JointModelRevoluteUnboundedUnaligned"
    comparison = Comparison(model)
    for part in (comparison.poses, comparison.frame_motion, comparison.center, comparison.forces, comparison.manifold):
        part()
    comparison.check()


FOLLOWERS = {
    "turn": pin.JointModelRX,
    "shift": pin.JointModelPY,
    "slanted turn": lambda: pin.JointModelRevoluteUnaligned(SLANTED),
    "slanted shift": lambda: pin.JointModelPrismaticUnaligned(SLANTED),
    "unbounded": pin.JointModelRUBZ,
}


def mimicking(leader: pin.JointModel, follower: pin.JointModel, scaling: float = -1.5) -> pin.Model:
    model = chain([pin.JointModelRZ(), leader, pin.JointModelRY(), follower])
    return pin.transformJointIntoMimic(model, 2, 4, scaling, 0.3)


@pytest.mark.parametrize("name", FOLLOWERS)
def test_mimic_joint(name: str) -> None:
    """Leader and follower on one chain, so that their columns add."""
    model = mimicking(FOLLOWERS[name](), FOLLOWERS[name]())
    assert (model.njoints - 1, model.nv) == (5, 4)
    assert mimic_errors(model) == {}


@pytest.mark.parametrize("file", ["pr2_description/urdf/pr2.urdf", "baxter_description/urdf/baxter.urdf"])
def test_mimic_joints_of_a_robot(file: str) -> None:
    model = pin.buildModelFromUrdf(str(DESCRIPTIONS / file), mimic=True)
    assert len(model.mimicking_joints) > 0
    assert mimic_errors(model) == {}


def mimic_errors(model: pin.Model) -> dict[str, float]:
    """Quantities that Pinocchio computes for models with mimic joints, where they are too far off."""
    comparison = Comparison(model)
    kin, data, q, v = comparison.kinematics, comparison.data, comparison.q, comparison.v
    comparison.forces()
    comparison.add("A_g", comparison.centroidal.matrix, pin.ccrba(model, data, q, v))
    comparison.add("momentum", comparison.centroidal.momentum, data.hg.vector)
    comparison.add("com J", kin.center_of_mass_jacobian, pin.jacobianCenterOfMass(model, data, q))
    comparison.add("com", kin.center_of_mass, data.com[0])
    comparison.manifold()
    comparison.poses()
    return {name: error for name, error in comparison.errors().items() if error > TOLERANCE}


def test_mimic_kinetic_energy_is_that_of_its_mass_matrix() -> None:
    model = mimicking(pin.JointModelRX(), pin.JointModelRX())
    dynamics = Dynamics(Kinematics(model))
    kin = dynamics.kinematics
    q, v, _ = random_state(model, "energy")
    gap = dynamics.kinetic_energy - 0.5 * ca.dot(kin.v, dynamics.mass_matrix @ kin.v)
    assert abs(float(ca.Function("gap", [kin.q, kin.v], [gap])(q, v))) < 1e-12


def test_unsupported_joint_type_is_named_with_the_choices() -> None:
    model = chain([pin.JointModelRX(), pin.JointModelEllipsoid(0.1, 0.2, 0.3)])
    with pytest.raises(UnsupportedJointError) as caught:
        Kinematics(model)
    assert caught.value.field == "joint 'joint1'"
    assert caught.value.value == "Ellipsoid"
    assert "Composite" in caught.value.choices
    with pytest.raises(UnsupportedJointError, match="hidden"):
        Kinematics(hidden_ellipsoid())


def hidden_ellipsoid() -> pin.Model:
    inside = pin.JointModelComposite()
    inside.addJoint(pin.JointModelRX(), pin.SE3.Identity())
    inside.addJoint(pin.JointModelEllipsoid(0.1, 0.2, 0.3), pin.SE3.Identity())
    model = pin.Model()
    model.addJoint(0, inside, pin.SE3.Identity(), "hidden")
    return model


def test_mimic_joints_that_cannot_be_read_are_refused() -> None:
    with pytest.raises(UnsupportedJointError, match="turn or a shift"):
        Kinematics(mimicking(pin.JointModelHZ(0.3), pin.JointModelHZ(0.3)))
    with pytest.raises(UnsupportedJointError, match="scaling 0"):
        Kinematics(mimicking(pin.JointModelRX(), pin.JointModelRX(), 0.0))


def test_a_name_of_several_frames_means_the_link() -> None:
    model = load("anymal_c_simple_description/urdf/anymal.urdf")
    same = [i for i, f in enumerate(model.frames) if f.name == "LF_HAA"]
    assert len(same) == 2
    assert model.frames[frame_index(model, "LF_HAA")].type == pin.FrameType.BODY


def test_unknown_names_are_refused() -> None:
    kin = Kinematics(chain([pin.JointModelRX()]))
    motion = Velocities(kin)
    with pytest.raises(UnknownNameError, match="'branch_tip'"):
        kin.pose("branch_tap")
    with pytest.raises(UnknownNameError, match="reference"):
        kin.jacobian("tip", "body")
    for call in (motion.frame_velocity, motion.bias_acceleration, motion.jacobian_drift):
        with pytest.raises(UnknownNameError, match="reference"):
            call("tip", "body")
    with pytest.raises(UnknownNameError, match="kind"):
        motion.bias_acceleration("tip", "local", "true")


def test_the_world_is_at_rest() -> None:
    kin = Kinematics(chain([pin.JointModelRX()]))
    motion = Velocities(kin)
    assert kin.jacobian("world").nnz() == 0
    for reference in ("world_aligned", "local", "world"):
        assert motion.frame_velocity("world", reference).is_zero()
        assert motion.bias_acceleration("world", reference).is_zero()


def test_a_model_without_mass() -> None:
    model = pin.Model()
    model.addJoint(0, pin.JointModelRX(), pin.SE3.Identity(), "only")
    model.appendBodyToJoint(0, BOX, pin.SE3.Identity())
    dynamics = Dynamics(Kinematics(model))
    parts = Centroidal(dynamics)
    kin = dynamics.kinematics
    assert kin.mass == 0.0
    for expression in (
        kin.center_of_mass,
        kin.center_of_mass_jacobian,
        parts.center_of_mass_velocity,
        parts.center_of_mass_drift,
        parts.matrix,
        dynamics.gravity,
        dynamics.inverse_dynamics,
        dynamics.mass_matrix,
    ):
        assert expression.is_zero()


@pytest.mark.parametrize("change", ["pitch", "armature", "gravity", "axis"])
def test_the_fingerprint_of_a_robot_sees_everything_that_the_expressions_use(change: str) -> None:
    def robot(value: float) -> Robot:
        model = chain([pin.JointModelHX(value if change == "pitch" else 0.3)])
        if change == "armature":
            model.armature = np.full(model.nv, value)
        if change == "gravity":
            model.gravity.linear = np.array([0.0, 0.0, -value])
        if change == "axis":
            model = unaligned_unbounded((0.0, np.cos(value), np.sin(value)))
        none = np.full(model.nv, np.inf)
        return Robot("chain", model, Limits(-none, none, none, none, none))

    assert robot(0.5).fingerprint == robot(0.5).fingerprint
    assert robot(0.5).fingerprint != robot(0.5000001).fingerprint


def test_world_is_the_fixed_root_even_if_a_floating_robot_has_a_link_of_that_name() -> None:
    model = load("ur_description/urdf/ur5_robot.urdf", "floating")
    assert model.existFrame("world")
    kin = Kinematics(model)
    assert kin.pose("world").position.is_zero()
    assert np.array_equal(ca.DM(kin.pose("world").rotation).full(), np.eye(3))
    assert kin.jacobian("world").nnz() == 0
