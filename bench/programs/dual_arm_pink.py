"""PR2 carries a box with both hands round a loop, with pink."""

import sys

import numpy as np
import pink
import pinocchio as pin

DT, GAIN, TICKS = 0.02, 10.0, 400
ANGLES = {"shoulder_pan": 0.4, "shoulder_lift": 0.3, "upper_arm_roll": 0.3, "elbow_flex": -1.5, "wrist_flex": -1.0}
HANDS = ("l_gripper_tool_frame", "r_gripper_tool_frame")
whole = pin.buildModelFromUrdf(sys.argv[1])
words = ("gripper", "laser", "torso", "head", "caster", "wheel")
still = [j for j in range(1, whole.njoints) if any(word in whole.names[j] for word in words)]
model = pin.buildReducedModel(whole, still, pin.neutral(whole))
start, angles = model.createData(), np.zeros(model.nv)
for name, value in ANGLES.items():
    for side, sign in (("l", 1.0), ("r", -1.0)):
        joint = model.getJointId(f"{side}_{name}_joint")
        angles[model.idx_vs[joint]] = sign * value if name in ("shoulder_pan", "upper_arm_roll") else value
q = pin.integrate(model, pin.neutral(model), angles)
pin.framesForwardKinematics(model, start, q)
hands = [start.oMf[model.getFrameId(hand)] for hand in HANDS]
box = pin.SE3(np.eye(3), (hands[0].translation + hands[1].translation) / 2)
for side, hand, pose in zip(("left", "right"), HANDS, hands, strict=True):
    above = model.frames[model.getFrameId(hand)]
    placed = above.placement * pose.actInv(box)
    model.addFrame(pin.Frame(f"box_{side}", above.parentJoint, placed, pin.FrameType.OP_FRAME))
configuration = pink.Configuration(model, model.createData(), q)
grasp = pink.tasks.RelativeFrameTask("box_right", "box_left", 100.0, 100.0, gain=GAIN * DT)
grasp.set_target(pin.SE3.Identity())
left = pink.tasks.FrameTask("box_left", 1.0, 1.0, gain=GAIN * DT)
right = pink.tasks.FrameTask("box_right", 1.0, 1.0, gain=GAIN * DT)
posture = pink.tasks.PostureTask(cost=1e-3, gain=DT)
posture.set_target_from_configuration(configuration)


def goal(k: float) -> pin.SE3:
    """A loop of 0.3 m by 0.24 m, at rest at both ends, on which the box turns by 0.3 rad to either side."""
    phase = 2 * np.pi * (k / TICKS - np.sin(2 * np.pi * k / TICKS) / (2 * np.pi))
    move = np.array([0.0, 0.15 * np.sin(phase), 0.12 * (1 - np.cos(phase))])
    return pin.SE3(pin.exp3(np.array([0.0, 0.0, 0.3 * np.sin(phase)])), box.translation + move)


late = slipped = 0.0
for k in range(TICKS):
    # pink has no velocity of a target: it is aimed at ahead by 1 / gain
    ahead = goal(k + 1 / (GAIN * DT))
    left.set_target(ahead)
    right.set_target(ahead)
    places = [configuration.get_transform_frame_to_world(f"box_{side}").translation for side in ("left", "right")]
    late = max(late, np.linalg.norm(places[0] - goal(k).translation))
    slipped = max(slipped, np.linalg.norm(places[0] - places[1]))
    v = pink.solve_ik(configuration, [grasp, left, right, posture], DT, solver="daqp")
    configuration.integrate_inplace(v, DT)

print(f"box at most {1e3 * late:.2f} mm off its path;")
print(f"where the two hands have it: at most {1e3 * slipped:.3f} mm apart")
if late > 0.05 or slipped > 5e-3:
    raise SystemExit("the box left its path, or the hands moved against each other")
