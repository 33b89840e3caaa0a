"""Trees of arms under manual control: E. Dupuis, "A General Framework for the Manual Teleoperation of Kinematically
Redundant Space-Based Manipulators", PhD thesis, McGill University, 2001, eqs. 4.34, 4.35, 4.43, 4.44 and 4.46 to 4.48.
"""

from __future__ import annotations

from math import pi

import numpy as np
import pytest

from tests.published.arm_machine import STATE, Machine, rates
from wbc.coordinates import Arm, BodyRows, Coordinate, JointRows, PairController, expressions, mode_pairs, parts
from wbc.robots import operator_arm


def seven(arm: Arm) -> tuple[Coordinate, ...]:
    """Pose and pitch plane."""
    assert arm.alpha is not None
    return (arm.tip, arm.alpha)


def test_a24_coordinates_of_the_whole_chain() -> None:
    """(4.47): 7 + 7 + 1 + 11 rows, 22 columns, full rank. With one constraint an arm, the plane's, the determinant is
    the product of those of arm, arm and carrier: ratio 1 to 1e-12.
    """
    found = parts("spdm_on_ssrms")
    robot, carrier = found.robot, found.carrier
    assert carrier is not None
    assert carrier.middle is not None
    assert found.body is not None
    body = JointRows(found.body)
    start = (*seven(found.arms[0]), *seven(found.arms[1]), body)
    tall = (*start, carrier.tip, carrier.middle, *carrier.in_plane)
    square = (*start, *seven(carrier))
    both = expressions.rate_function(robot, tall), expressions.rate_function(robot, square)
    singles = {"arm1_": "spdm_arm", "arm2_": "spdm_arm", "carrier_": "ssrms"}
    own = {
        name: expressions.rate_function(parts(name).robot, seven(parts(name).arms[0])) for name in ("spdm_arm", "ssrms")
    }
    for q in np.random.default_rng(8).uniform(-pi, pi, (20, 22)):
        every, chosen = (np.asarray(f(q).full()) for f in both)
        assert every.shape == (26, 22)
        assert np.linalg.matrix_rank(every, 1e-9) == 22
        product = 1.0
        for prefix, name in singles.items():
            joints = [robot.dofs(f"{prefix}joint{k}").start for k in range(1, 8)]
            product *= np.linalg.det(np.asarray(own[name](q[joints]).full()))
        assert abs(np.linalg.det(chosen) / product) == pytest.approx(1.0, abs=1e-12)


def test_a24_the_body_turns_with_held_hands_and_one_arm_moves_alone() -> None:
    """(4.44), (4.43) on 15 joints: twists of both hands below 1e-10; then only the commanded arm moves."""
    names = ("body_joint | hands", "arm1_xi | the rest")
    robot, pairs = operator_arm("spdm").robot, [p for p in mode_pairs("spdm", "M6") if p.name in names]
    control, machine = PairController(robot, pairs, limits=False, backend="vm"), Machine(robot)
    q = np.concatenate(([0.2], STATE, STATE[::-1]))
    v = rates(control, names[0], q, [0.02])
    for k in (1, 2):
        assert np.abs(machine.rows(f"arm{k}_tip", q) @ v).max() < 1e-10
    assert v[robot.dofs("body_joint").start] == pytest.approx(0.02, abs=1e-9)
    command = np.array((0.01, 0.0, 0.02, 0.0, 0.005, 0.0))
    v = rates(control, names[1], q, command)
    np.testing.assert_allclose(machine.rows("arm1_tip", q) @ v, command, atol=1e-9)
    moved = [robot.dofs(f"arm1_joint{k}").start for k in range(1, 8)]
    assert np.abs(np.delete(v, moved)).max() < 1e-12
    assert np.abs(v[moved]).min() > 1e-6


def test_a24_trees() -> None:
    """det J_R is the product of the arms', and of the carrier's; there the body joint moves no hand."""
    rng = np.random.default_rng(8)
    for name, count in (("spdm", 15), ("spdm_on_ssrms", 22)):
        tree = operator_arm(name).robot
        machine, single = Machine(tree), Machine(operator_arm("spdm_arm").robot)
        q = rng.uniform(-1.0, 1.0, count)
        rows, product_of = [], 1.0
        for k in (1, 2):
            joints = [tree.dofs(f"arm{k}_joint{i}").start for i in range(1, 8)]
            lock = np.zeros(count)
            lock[joints[0]] = 1.0
            rows += [machine.rows(f"arm{k}_tip", q), lock[None]]
            product_of *= np.linalg.det(np.vstack((single.rows("tip", q[joints]), np.eye(7)[:1])))
        rows.append(np.eye(count)[None, tree.dofs("body_joint").start])
        if name == "spdm_on_ssrms":
            carrier = Machine(operator_arm("ssrms").robot)
            joints = [tree.dofs(f"carrier_joint{i}").start for i in range(1, 8)]
            lock = np.zeros((1, count))
            lock[0, joints[0]] = 1.0
            rows += [machine.rows("carrier_tip", q), lock]
            product_of *= np.linalg.det(np.vstack((carrier.rows("tip", q[joints]), np.eye(7)[:1])))
            assert not np.vstack((rows[0], rows[2]))[:, tree.dofs("body_joint").start].any()
        assert abs(np.linalg.det(np.vstack(rows))) == pytest.approx(abs(product_of), rel=1e-9)


def test_a24_hands_held_while_the_carrier_moves() -> None:
    """Self-motion of 22 joints: both hands stay in space, the arm that is not commanded and the body joint at rest."""
    robot = parts("spdm_on_ssrms").robot
    pairs = (*mode_pairs("spdm_on_ssrms", "M7"), mode_pairs("spdm_on_ssrms", "M6")[0])
    control = PairController(robot, pairs, limits=False, backend="vm")
    q = np.concatenate((STATE, [0.1], STATE, STATE[::-1]))
    command = (0.001, 0.0, 0.002, 0.0, 0.0005, 0.0)
    v = rates(control, "carrier_xi | hands", q, command)
    matrices = control.rates(q)
    for k in (1, 2):
        assert np.abs(matrices[BodyRows(f"arm{k}_tip")] @ v).max() < 1e-10
    np.testing.assert_allclose(matrices[BodyRows("carrier_tip")] @ v, command, atol=1e-8)
    v = rates(control, "arm1_xi | the rest", q, command)
    moved = [robot.dofs(f"arm1_joint{k}").start for k in range(1, 8)]
    assert np.abs(np.delete(v, moved)).max() < 1e-12
    assert np.abs(v[moved]).min() > 1e-6
    assert pi > np.abs(v).max()
