"""The pitch plane's row of the task against that of the thesis: E. Dupuis, "A General Framework for the Manual
Teleoperation of Kinematically Redundant Space-Based Manipulators", PhD thesis, McGill University, 2001, chapter 4.

Determinants, loci, ranks and motions of the published arms follow from this row and Pinocchio's Jacobians; they are in
the files that docs/task_constraint_published.md names.
"""

from __future__ import annotations

import casadi as ca
import numpy as np
import pinocchio as pin
import pytest

from tests import models
from tests.published.arm_machine import STATE, Machine
from wbc.robot import Robot
from wbc.symbolic import Kinematics, Tracer
from wbc.tasks.pitch_plane import PitchPlane

#: Lengths of a Space Station arm that nobody built
LENGTHS = np.random.default_rng(0).uniform(0.2, 2.0, (4, 5))
#: Robot, its wrist, and the axis of its pitch joints in their frames
ARMS: dict[str, tuple[Robot, str, int]] = {
    "four joints": (models.four_joint_arm(), "tip", 1),
    "Space Station": (models.ssrms(), "F5", 1),
    "Space Station, simplified": (models.arm("simple", models.ssrms_links(1.0, 0.0, 0.0, 0.0, 0.0)), "F5", 1),
    "dexterous": (models.spdm_arm(), "F5", 2),
    **{f"lengths {k}": (models.arm("any", models.ssrms_links(*row)), "F5", 1) for k, row in enumerate(LENGTHS)},
}


def row_of(robot: Robot, wrist: str, prefix: str = "", base: str = "world") -> ca.Function:
    """The task's row, and how much of it is left where it fades."""
    item = PitchPlane(prefix + "F3", prefix + "F4", prefix + wrist, axis=prefix + "joint3", base=base)
    item.validate(robot)
    kin = Tracer(Kinematics(robot.model))
    row, factor = ca.densify(item.jacobian(robot, kin, {})), kin.expand(item.row_factor(robot, kin, {}))
    return ca.Function("alpha", [kin.q], [row, factor])


@pytest.mark.parametrize("name", ARMS)
def test_the_row_is_the_rate_about_the_common_normal(name: str) -> None:
    """alpha = (r / |r|).omega_2 with r the common normal of the shoulder and wrist pitch axes; corrected (4.38)."""
    robot, wrist, pitch = ARMS[name]
    function, machine = row_of(robot, wrist), Machine(robot)
    for q in np.random.default_rng(1).uniform(-np.pi, np.pi, (100, robot.nq)):
        row = np.array(function(q)[0])
        np.testing.assert_allclose(row[0], machine.alpha(q, pitch, wrist), rtol=0, atol=1e-12)
        np.testing.assert_array_equal(row[0, 2:], np.zeros(robot.nv - 2))


def test_a_folded_arm_switches_the_row_off() -> None:
    """q4 = pi: the pitch axes coincide, r = 0, alpha is undefined (a division by zero in the thesis)."""
    function, folded = row_of(models.ssrms(), "F5"), STATE.copy()
    folded[3] = np.pi
    row, factor = function(folded)
    assert np.isfinite(np.array(row)).all()
    assert (float(factor), float(function(STATE)[1])) == (0.0, 1.0)


def test_a_row_from_the_mounting_has_nothing_of_the_carrying_arm() -> None:
    """Two compact arms and a body joint on the tip of the Space Station arm: from its mounting a row is the lone arm's,
    and so is its part in that of the world; with one row an arm (4.48) is the product of three determinants.
    """
    model = pin.Model()
    last = models.add_chain(model, models.ssrms_links(**models.SSRMS_OFFSETS), "s_")
    body = pin.SE3(np.eye(3), np.array([models.SSRMS_OFFSETS["x7"], 0, 0]))
    for prefix, side in (("a_", 1.0), ("b_", -1.0)):
        mount = body * pin.SE3(pin.rpy.rpyToMatrix(0.3 * side, 0.2, 1.1 * side), np.array([0.4, 0.5 * side, 0.1]))
        models.add_chain(model, models.spdm_links(), prefix, last, mount)
    models.add_chain(model, [(models.Z, (0, 0, 0))], "body_", last, body)
    model.addFrame(pin.Frame("base", last, 0, body, pin.FrameType.OP_FRAME))
    robot = models.robot("composite", model)
    machine, lone, relative = Machine(robot), row_of(models.spdm_arm(), "F5"), row_of(robot, "F5", "a_", "base")
    rows = {prefix: row_of(robot, "F5", prefix) for prefix in ("a_", "b_", "s_")}
    columns = {p: [k for k, n in enumerate(robot.dof_names) if n.startswith(p)] for p in (*rows, "body_")}
    for q in np.random.default_rng(12).uniform(-np.pi, np.pi, (20, 22)):
        found, own = np.array(relative(q)[0])[0], np.array(lone(q[columns["a_"]])[0])[0]
        np.testing.assert_array_equal(np.delete(found, columns["a_"]), np.zeros(15))
        np.testing.assert_allclose(found[columns["a_"]], own, atol=1e-12)
        np.testing.assert_allclose(np.array(rows["a_"](q)[0])[0, columns["a_"]], own, atol=1e-12)
        blocks = {p: np.vstack([machine.rows(f"{p}tip", q), np.array(row(q)[0])]) for p, row in rows.items()}
        product = np.prod([np.linalg.det(block[:, columns[p]]) for p, block in blocks.items()])
        matrix = np.vstack([*blocks.values(), np.eye(22)[columns["body_"]]])
        assert np.linalg.det(matrix[:, np.concatenate([*columns.values()])]) == pytest.approx(product, rel=1e-9)
