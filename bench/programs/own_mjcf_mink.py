"""An MJCF file of one's own, with mink."""

import sys

import mink
import mujoco
import numpy as np

DT = 0.002
model = mujoco.MjModel.from_xml_path(sys.argv[1])
configuration = mink.Configuration(model)
configuration.update_from_keyframe("home")
tool = mink.FrameTask("tool", "site", position_cost=1.0, orientation_cost=1.0, gain=10.0 * DT)
posture = mink.PostureTask(model, cost=1e-2, gain=DT)
posture.set_target_from_configuration(configuration)
velocities = {model.joint(j).name: 2.0 for j in range(model.njnt)}
limits = [mink.ConfigurationLimit(model), mink.VelocityLimit(model, velocities)]

pose = configuration.get_transform_frame_to_world("tool", "site")
target = mink.SE3.from_rotation_and_translation(pose.rotation(), pose.translation() + [0.1, 0.2, -0.1])
tool.set_target(target)
for _ in range(1000):
    v = mink.solve_ik(configuration, [tool, posture], DT, "daqp", limits=limits)
    configuration.integrate_inplace(v, DT)

error = np.linalg.norm(configuration.data.site("tool").xpos - target.translation())
print(f"MuJoCo has the tool {1e3 * error:.3f} mm from its target")
if error > 1e-3:
    raise SystemExit("the tool did not arrive")
