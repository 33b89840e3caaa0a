"""An honest walk, made by closed-form inverse kinematics: the body moves on two hands while the third changes hold."""

from __future__ import annotations

import functools
from math import pi

import numpy as np
import pinocchio as pin

from wbc.robots import walker
from wbc.walking import ArmKinematics, Hold, Structure
from wbc.walking.holds.surface import PlaneSurface
from wbc.walking.log.log import CLOSED, CLOSING, OPEN, OPENING, WalkLog
from wbc.walking.log.recorder import LogRecorder

INCH = 0.0254
DT, HEIGHT, LIFT, RADIUS = 0.01, 52 * INCH, 5.0 * INCH, 30 * INCH
#: Seconds: holding at both ends, opening and closing, swinging. In the swing a joint reaches 0.987 of its rate
HOLD, LATCH, SWING = 0.3, 0.1, 1.1
MACHINE = walker()
ARM = ArmKinematics(MACHINE.arm_data)
#: Looking down on the plane: x along x, z into the structure
DOWN = pin.utils.rotate("x", pi)
#: Holds lean inwards, so that the wrists stay away from their singularity
LEAN = pin.utils.rotate("y", -0.35)


def structure(roll: str | int = "free", max_tilt: float = 0.0) -> Structure:
    """A plane with a hold under each hand, and one ahead of the first."""
    holds = []
    for k in range(3):
        turn = DOWN @ pin.utils.rotate("z", 2 * pi * k / 3)
        holds.append(Hold(f"under {k + 1}", pin.SE3(turn @ LEAN, RADIUS * turn[:, 0]), roll, max_tilt))
    ahead = pin.SE3(DOWN @ LEAN, np.array([RADIUS + 0.2, 0.0, 0.0]))
    return Structure("four holds", (*holds, Hold("ahead", ahead, roll, max_tilt)), (), PlaneSurface(pin.SE3.Identity()))


def smooth(x: float) -> float:
    """0 to 1 with speed and acceleration 0 at both ends."""
    x = min(max(x, 0.0), 1.0)
    return x**3 * (10 - 15 * x + 6 * x * x)


@functools.cache
def honest(
    roll: str | int = "free", max_tilt: float = 0.0, lift: float = LIFT, creep: float = 0.0
) -> tuple[WalkLog, Structure]:
    """The log and its structure.

    Two faults may be built in: a swing as low as ``lift``, and the second hand creeping by ``creep``.
    """
    ground = structure(roll, max_tilt)
    count = round((2 * HOLD + 2 * LATCH + SWING) / DT) + 1
    open_at, close_at = HOLD + LATCH, HOLD + LATCH + SWING
    poses, q, states, holds = [], [], [], []
    for t in DT * np.arange(count):
        body = pin.SE3(DOWN, np.array([0.1 * smooth(t / (DT * (count - 1))), 0.0, HEIGHT]))
        part = (t - open_at) / SWING
        up = lift * smooth(part / 0.4) * smooth((1 - part) / 0.4)
        hand = ground["under 1"].position + [0.2 * smooth((part - 0.2) / 0.6), 0.0, up]
        slid = creep * smooth(t / (DT * (count - 1))) * ground["under 2"].pose.rotation[:, 0]
        grips = [hand, ground["under 2"].position + slid, ground["under 3"].position]
        row = []
        for arm, grip, hold in zip(MACHINE.arms, grips, ground.holds, strict=False):
            local = (body * arm.base).inverse()
            target = local * pin.SE3(hold.pose.rotation, grip)
            if roll == "free":
                found, valid = ARM.inverse_axis(target.translation[None], target.rotation[None, :, 2])
            else:
                found, valid = ARM.inverse(target.homogeneous[None])
            assert valid[0, 1]
            row.append(found[0, 1])
        q.append(np.concatenate(row))
        poses.append(body)
        phase = [HOLD, open_at, close_at, close_at + LATCH, np.inf]
        state = (CLOSED, OPENING, OPEN, CLOSING, CLOSED)[int(np.searchsorted(phase, t + 1e-9))]
        states.append([state, CLOSED, CLOSED])
        holds.append([0 if t + 1e-9 < open_at else 3, 1, 2])
    return _recorded(ground, poses, np.unwrap(np.array(q), axis=0), states, holds), ground


def _recorded(ground: Structure, poses: list[pin.SE3], q: np.ndarray, states: list, holds: list) -> WalkLog:  # type: ignore[type-arg]
    names = [arm.name for arm in MACHINE.arms], [arm.hand for arm in MACHINE.arms]
    joints = [joint for arm in MACHINE.arms for joint in arm.joints]
    digest = MACHINE.data.digest
    recorder = LogRecorder(ground, joints, *names, dt=DT, seed=0, robot="walker", robot_digest=digest, capacity=16)
    for k, pose in enumerate(poses):
        after = min(k + 1, len(poses) - 1)
        rates = (q[after] - q[k]) / DT
        twist = pin.log6(pose.actInv(poses[after])).vector / DT
        recorder.append(k * DT, pose, q[k], rates, twist, states[k], holds[k], command=np.r_[0.1, np.zeros(5)])
    return recorder.log()
