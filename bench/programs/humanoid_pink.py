"""TALOS reaches forward with one hand on held feet, its centre of mass over them, with pink."""

import sys

import numpy as np
import pink
import pinocchio as pin

DT = 0.005
FEET, HAND = ("left_sole_link", "right_sole_link"), "gripper_right_base_link"
model = pin.buildModelFromUrdf(sys.argv[1], pin.JointModelFreeFlyer())
q = pin.neutral(model)
for name, value in zip(sys.argv[2::2], sys.argv[3::2], strict=True):
    q[model.idx_qs[model.getJointId(name)]] = float(value)
configuration = pink.Configuration(model, model.createData(), q)
hand = pink.tasks.FrameTask(HAND, position_cost=1.0, orientation_cost=0.0, gain=DT)
balance = pink.tasks.ComTask(cost=[1.0, 1.0, 0.0], gain=DT)
posture = pink.tasks.PostureTask(cost=1e-2, gain=DT)
feet = [pink.tasks.FrameTask(foot, position_cost=1.0, orientation_cost=1.0) for foot in FEET]
for task in (hand, posture, balance, *feet):
    task.set_target_from_configuration(configuration)
start = configuration.get_transform_frame_to_world(HAND)
target = start.translation + [0.3, 0.1, 0.1]
hand.set_target(pin.SE3(start.rotation, target))
placed = [configuration.get_transform_frame_to_world(foot) for foot in FEET]
# pink has no support polygon: the centre of mass goes to its middle
middle = (placed[0].translation + placed[1].translation) / 2
balance.set_target(np.array([*middle[:2], 0.0]))

for _ in range(800):
    v = pink.solve_ik(configuration, [hand, balance, posture], DT, solver="daqp", constraints=feet, safety_break=False)
    configuration.integrate_inplace(v, DT)

error = np.linalg.norm(configuration.get_transform_frame_to_world(HAND).translation - target)
moved = np.linalg.norm(configuration.get_transform_frame_to_world(FEET[0]).translation - placed[0].translation)
mass = pin.centerOfMass(model, configuration.data, configuration.q)
print(f"hand {1e3 * error:.2f} mm from its target, left foot moved {1e6 * moved:.2f} um")
print(f"centre of mass {1e3 * np.linalg.norm((mass - middle)[:2]):.1f} mm from the middle of the feet")
if error > 0.02 or moved > 1e-3:
    raise SystemExit("the hand did not arrive, or a foot moved")
