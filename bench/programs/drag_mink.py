"""An arm in a window (mink has no browser): drag its hand's target with the mouse; needs a display."""

import sys

import mink
import mujoco
import mujoco.viewer
from loop_rate_limiters import RateLimiter

DT = 0.01
spec = mujoco.MjSpec.from_file(sys.argv[1])
target = spec.worldbody.add_body(name="target", mocap=True)
target.add_geom(type=mujoco.mjtGeom.mjGEOM_BOX, size=[0.05, 0.05, 0.05], contype=0, conaffinity=0)
model = spec.compile()
data = mujoco.MjData(model)
configuration = mink.Configuration(model)
configuration.update_from_keyframe("home")
hand = mink.FrameTask("tool", "site", position_cost=1.0, orientation_cost=1.0, gain=5.0 * DT)
posture = mink.PostureTask(model, cost=1e-2, gain=DT)
posture.set_target_from_configuration(configuration)
velocities = {model.joint(j).name: 2.0 for j in range(model.njnt)}
limits = [mink.ConfigurationLimit(model), mink.VelocityLimit(model, velocities)]

with mujoco.viewer.launch_passive(model, data) as viewer:
    data.qpos[:] = configuration.q
    mujoco.mj_forward(model, data)
    mink.move_mocap_to_frame(model, data, "target", "tool", "site")
    rate = RateLimiter(frequency=1.0 / DT)
    while viewer.is_running():
        hand.set_target(mink.SE3.from_mocap_name(model, data, "target"))
        v = mink.solve_ik(configuration, [hand, posture], DT, "daqp", limits=limits)
        configuration.integrate_inplace(v, DT)
        data.qpos[:] = configuration.q
        mujoco.mj_forward(model, data)
        viewer.sync()
        rate.sleep()
