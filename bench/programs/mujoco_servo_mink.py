"""A MuJoCo arm on its own position servos at 1 kHz, with mink: its configuration is what the servos are sent."""

import sys

import mink
import mujoco
import numpy as np

DT, GAIN = 0.001, 20.0
model = mujoco.MjModel.from_xml_path(sys.argv[1])
data = mujoco.MjData(model)
mujoco.mj_resetDataKeyframe(model, data, model.key("home").id)
configuration = mink.Configuration(model, data.qpos.copy())
tool = mink.FrameTask("tool", "site", position_cost=1.0, orientation_cost=1.0, gain=GAIN * DT)
posture = mink.PostureTask(model, cost=3e-2, gain=DT)
posture.set_target_from_configuration(configuration)
velocities = {model.joint(j).name: 3.0 for j in range(model.njnt)}
limits = [mink.ConfigurationLimit(model), mink.VelocityLimit(model, velocities)]
# Actuators are not in the order of the joints
order = [int(model.jnt_qposadr[model.actuator_trnid[a, 0]]) for a in range(model.nu)]
data.ctrl[:] = configuration.q[order]


def eight(t: float) -> np.ndarray:
    """A figure of eight of 0.2 m in 2 s that begins at rest [m]."""
    return min(t, 1.0) * np.array([0.0, 0.1 * np.sin(np.pi * t), 0.1 * np.sin(2 * np.pi * t)])


pose, errors = configuration.get_transform_frame_to_world("tool", "site"), []
for k in range(4000):
    here, there = eight(k * DT), eight((k + 1) * DT)
    # mink has no velocity of a target: what would be fed forward is added to it
    ahead = here + (there - here) / DT / GAIN
    tool.set_target(mink.SE3.from_rotation_and_translation(pose.rotation(), pose.translation() + ahead))
    v = mink.solve_ik(configuration, [tool, posture], DT, "daqp", limits=limits)
    configuration.integrate_inplace(v, DT)
    data.ctrl[:] = configuration.q[order]
    mujoco.mj_step(model, data)
    errors.append(np.linalg.norm(data.site("tool").xpos - pose.translation() - here))

print(f"tool {1e3 * np.median(errors[2000:]):.2f} mm (median), {1e3 * max(errors[2000:]):.2f} mm (worst) off")
if np.median(errors[2000:]) > 0.003:
    raise SystemExit("the tool does not follow")
