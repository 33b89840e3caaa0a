"""A URDF of one's own, with pink."""

import sys

import numpy as np
import pink
import pinocchio as pin

DT = 0.005
model = pin.buildModelFromUrdf(sys.argv[1])
q = pin.neutral(model)
for name, value in {"shoulder": 0.4, "elbow": 1.2}.items():
    q[model.idx_qs[model.getJointId(name)]] = value
configuration = pink.Configuration(model, model.createData(), q)
tool = pink.tasks.FrameTask("tool", position_cost=1.0, orientation_cost=0.0, gain=10.0 * DT)
posture = pink.tasks.PostureTask(cost=1e-2, gain=DT)
posture.set_target_from_configuration(configuration)
limits = [pink.limits.ConfigurationLimit(model), pink.limits.VelocityLimit(model)]
limits.append(pink.limits.AccelerationLimit(model, np.full(model.nv, 20.0)))

start = configuration.get_transform_frame_to_world("tool")
for corner in ([0.0, 0.1, 0.0], [0.0, 0.1, -0.2], [0.0, -0.1, -0.2], [0.0, -0.1, 0.0]):
    tool.set_target(pin.SE3(start.rotation, start.translation + corner))
    for _ in range(300):
        v = pink.solve_ik(configuration, [tool, posture], DT, solver="daqp", limits=limits)
        limits[-1].set_last_integration(v, DT)
        configuration.integrate_inplace(v, DT)
    here = configuration.get_transform_frame_to_world("tool").translation
    error = np.linalg.norm(here - start.translation - corner)
    print(f"{1e3 * error:.3f} mm from {start.translation + corner}")
    if error > 1e-3:
        raise SystemExit("the tool did not arrive")
