"""What body and hand follow in a tick, computed as one expression each: Pinocchio and the law's table as referees."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

import wbc
from wbc.walking import cylinder
from wbc.walking.body_path import grid_path
from wbc.walking.loop.body_command import BodyCommand
from wbc.walking.loop.hand_command import braking
from wbc.walking.loop.stack import SWING_GAIN
from wbc.walking.loop.walk import Walk
from wbc.walking.planner.planner import plan_walk

DT = 0.01


def test_the_body_is_led_from_where_it_is_to_where_it_is_to_be() -> None:
    path, command = grid_path([(13, 6), (14, 7, 0.3), (12, 7, -0.5)], 0.3), BodyCommand(DT)
    begin = 0.0
    for end in np.cumsum([0.0, 0.004, 0.03, 0.05, 0.0, 1.07, 5.0, 100.0]):
        before, after = path.at(begin)[0], path.at(end)[0]
        found = command.go(path, begin, end)
        turn = before.rotation @ pin.log3(before.rotation.T @ after.rotation)
        assert np.allclose(found[:12], before.homogeneous[:3].ravel(order="F"), atol=1e-12)
        assert np.allclose(found[12:15], (after.translation - before.translation) / DT, atol=1e-9)
        assert np.allclose(found[15:], turn / DT, atol=1e-9)
        assert pin.XYZQUATToSE3(command.pose).isApprox(after, 1e-12)
        begin = end
    # Another path, and a place that it did not come to by itself
    other = path.moved(pin.SE3(pin.exp3(np.array([0.1, 0.2, 0.3])), np.ones(3)))
    for place in (0.0, 1.3):
        assert np.allclose(command.go(other, place, place + 0.01)[9:12], other.at(place)[0].translation, atol=1e-12)


def test_a_hand_follows_its_law_and_its_wrist_goes_from_grip_to_grip() -> None:
    machine, structure = wbc.robots.walker(), cylinder(rigid=True)
    walk = Walk(machine, structure, plan_walk(machine, structure, grid_path([(13, 6), (13, 11)], 0.15)), backend="vm")
    seen = 0
    while not walk.done and seen < 150:
        arm, swinging = -1, walk.swinging
        if swinging is not None:
            arm, aim, bend, place = (
                swinging.arm,
                swinging.aim,
                np.array(swinging.wrist),
                walk.machine.chain.origins[swinging.arm],
            )
        elbow = walk.q[machine.arms[arm].q][2]
        walk.tick()
        if arm < 0 or walk.swinging is not swinging:
            continue
        now, sample = swinging.law.at(swinging.clock), walk.path_time / walk.plan.path.spacing
        both = walk.progress.grip[arm], swinging.grip
        first, last = (np.array(walk.progress.grips.wrist_at(grip, sample)) for grip in both)
        assert np.allclose(swinging.aim.position, now.position, atol=1e-12)
        assert np.allclose(swinging.aim.velocity, now.velocity, atol=1e-12)
        assert np.allclose(swinging.wrist, first + now.blend * (last - first), atol=1e-12)
        followed, joints = walk.stack._swings[arm], machine.arms[arm]
        gap = np.linalg.norm(aim.position - place)
        brakes = braking(machine.arm_data, elbow, SWING_GAIN)
        waits = place + (aim.position - place) * min(1.0, 0.02 / max(gap, 1e-9), np.sqrt(brakes / max(gap, 1e-9)))
        assert np.allclose(followed.target, waits, atol=1e-12)
        assert np.allclose(followed.feedforward, (now.position - aim.position) / DT, atol=1e-9)
        assert np.allclose(walk.stack.controller["posture"].target[joints.q][3:], bend, atol=1e-12)
        rates = (np.array(swinging.wrist) - bend) / DT
        assert np.allclose(walk.stack.controller["posture"].feedforward[joints.v][3:], rates, atol=1e-9)
        seen += 1
    assert seen == 150
