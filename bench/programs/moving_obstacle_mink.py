"""A hand follows a target on a circle while a ball flies through its path, with mink."""

import sys

import mink
import mujoco
import numpy as np

DT, GAIN = 0.005, 10.0
spec = mujoco.MjSpec.from_file(sys.argv[1])
ball = spec.worldbody.add_body(name="ball", mocap=True)
ball.add_geom(name="ball", type=mujoco.mjtGeom.mjGEOM_SPHERE, size=[0.1, 0, 0])
model = spec.compile()
configuration = mink.Configuration(model)
configuration.update_from_keyframe("home")
hand = mink.FrameTask("tool", "site", position_cost=1.0, orientation_cost=1.0, gain=GAIN * DT)
posture = mink.PostureTask(model, cost=1e-2, gain=DT)
posture.set_target_from_configuration(configuration)
links = [
    geom for b in range(1, model.nbody) for geom in mink.get_body_geom_ids(model, b) if geom != model.geom("ball").id
]
limits = [
    mink.ConfigurationLimit(model),
    mink.VelocityLimit(model, {model.joint(j).name: 2.0 for j in range(model.njnt)}),
    mink.CollisionAvoidanceLimit(
        model,
        [(links, ["ball"])],
        gain=5.0 * DT**2,
        minimum_distance_from_collisions=0.02,
        collision_detection_distance=0.3,
        # mink knows no velocity of an obstacle: all pairs give way at the ball's speed
        bound_relaxation=-0.3 * DT,
    ),
]

start = configuration.get_transform_frame_to_world("tool", "site")
nearest, errors, fromto = np.inf, [], np.zeros(6)
for tick in range(1600):
    t = tick * DT
    circle = 0.08 * np.array([0.0, np.sin(t), 1.0 - np.cos(t)])
    # mink has no velocity of a target: what would be fed forward is added to it
    ahead = 0.08 * np.array([0.0, np.cos(t), np.sin(t)]) / GAIN
    place = start.translation() + circle
    hand.set_target(mink.SE3.from_rotation_and_translation(start.rotation(), place + ahead))
    configuration.data.mocap_pos[0] = start.translation() + [0.08, 0.7 - 0.3 * t, 0.1]
    configuration.update()
    v = mink.solve_ik(configuration, [hand, posture], DT, "daqp", limits=limits)
    gaps = [mujoco.mj_geomDistance(model, configuration.data, g, model.geom("ball").id, 1.0, fromto) for g in links]
    nearest = min(nearest, min(gaps) - 0.02)
    errors.append(np.linalg.norm(configuration.data.site("tool").xpos - place))
    configuration.integrate_inplace(v, DT)

print(f"least distance beyond the margin {1e3 * nearest:.2f} mm, hand pushed {1e3 * max(errors):.0f} mm away")
print(f"at the end: hand error {1e3 * errors[-1]:.2f} mm")
if nearest < -1e-3 or errors[-1] > 1e-3:
    raise SystemExit("the arm touched the ball's margin, or did not come back to its target")
