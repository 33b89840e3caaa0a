"""For how long a hand can hold while the body moves on: by the planner's closed form, and by the rows of the stack."""

from __future__ import annotations

from math import pi

import numpy as np
import pinocchio as pin

import wbc
from tests.repeats import repeats
from wbc.robots import Margins, Walker, WalkerData
from wbc.validation import Array
from wbc.walking import Structure
from wbc.walking.body_path import BodyPath, grid_path
from wbc.walking.loop.stack import WalkStack
from wbc.walking.planner.grips.table import Grips, find_grips

INCH = 0.0254
#: (T, A, heading) from and to: across the grid, and a turn of the body where it is
PATHS = {"diagonal": [(11, 10, 0.3), (15, 13, 0.3)], "turn": [(13, 12, 0.0), (13, 12, 2 * pi / 3)]}
SPEED, TURN_RATE = 4 * INCH, 0.05
#: A quarter of a grid unit, on the circle of the wrists the same angle: samples of either path
STEP = {"diagonal": 0.25 * 9.25 * INCH / SPEED / 0.05, "turn": 0.25 * 9.25 / 30.0 / TURN_RATE / 0.05}
#: Samples from solution to solution, and grips of a path that are looked at
STRIDE, COUNT = 3, repeats(8)


def tight() -> Walker:
    """A machine whose limits are what the planner keeps of them."""
    data, margins = WalkerData.read(), Margins()
    limits, rates = (
        np.array(data.position_limits) - margins.held_angle,
        margins.held_rate * np.array(data.joint_rates),
    )
    less = WalkerData.read(position_limits=tuple(limits.tolist()), joint_rates=tuple(rates.tolist()))
    return wbc.robots.walker(data=less, artificial_limits=True)


class Rows:
    """The rows of a walk's stack, with one hand on a hold and the body at a pose."""

    def __init__(self, machine: Walker, structure: Structure) -> None:
        self.machine, self.structure = machine, structure
        self.solver = WalkStack(machine, structure, collisions=False, backend="vm").stack.inverse_kinematics(
            goals=("body",)
        )
        self.solver["posture"].enabled = False
        for arm in machine.arms:
            self.solver[f"{arm.name} swing"].enabled = self.solver[f"{arm.name} axis"].enabled = False

    def from_here(self, arm: int, hold: int, pose: Array, joints: Array) -> Array | None:
        """Joints of the arm, beginning from some ``[6]`` [rad]; None where they break a row."""
        machine = self.machine
        for k, one in enumerate(machine.arms):
            self.solver[f"{one.name} hold axis"].enabled = k == arm
        self.solver[f"{machine.arms[arm].name} hold axis"].target = pin.SE3(self.structure.frames[hold])
        body = pin.SE3(pose)
        self.solver["body"].target = body
        q = np.array(machine.robot.neutral)
        q[:3], q[3:7] = body.translation, pin.Quaternion(body.rotation).coeffs()
        q[machine.arms[arm].q] = joints
        found = self.solver.solve(q, restarts=0, budget=None)
        return np.asarray(found.q[machine.arms[arm].q]) if found.status == "solved" else None


def stretch(rows: Rows, path: BodyPath, grips: Grips, grip: int) -> list[int]:
    """First and last sample that the stack can hold, going out from the middle of a grip at the commanded speed."""
    arm, hold = int(grips.arm[grip]), int(grips.hold[grip])
    middle = int(grips.first[grip] + grips.last[grip]) // 2
    most = np.array(rows.machine.robot.limits.velocity[rows.machine.arms[arm].v])[:5] * path.spacing
    ends = []
    for sign in (-1, 1):
        sample, q, stride = middle, grips.posture_at(grip, middle), STRIDE
        while 0 <= sample + sign * stride < len(path):
            after = rows.from_here(arm, hold, path.poses[sample + sign * stride], q)
            used = np.inf if after is None else float((np.abs(after - q)[:5] / most).max()) / stride
            # Sample by sample where a joint is fast; with theta5 of the other sign it is another grip
            if stride > 1 and used > 0.5:
                stride = 1
            elif after is None or used > 1.0 or after[4] * q[4] < 0.0:
                break
            else:
                sample, q, stride = sample + sign * stride, after, STRIDE if used < 0.4 else 1
        ends.append(sample)
    return ends


def test_closed_form_and_rows_agree(machine: Walker, structure: Structure) -> None:
    rows = Rows(tight(), structure)
    for name, points in PATHS.items():
        path = grid_path(points, SPEED, TURN_RATE)
        grips = find_grips(machine, structure, path)
        chosen = np.random.default_rng(0).permutation(len(grips))[:COUNT].tolist()
        assert {int(grips.arm[g]) for g in chosen} == {0, 1, 2}
        for grip in chosen:
            planned = int(grips.first[grip]), int(grips.last[grip])
            found = stretch(rows, path, grips, grip)
            allowed = max(STEP[name], 0.05 * (planned[1] - planned[0]))
            where = f"{name}: arm {grips.arm[grip] + 1} on {structure.ids[grips.hold[grip]]}, {planned} and {found}"
            # Less than is planned would be worse than more
            assert planned[0] - found[0] >= -STRIDE, where
            assert found[1] - planned[1] >= -STRIDE, where
            assert np.abs(np.subtract(found, planned)).max() <= allowed, where
