"""A person's key points drive a G1 on held feet, with mink."""

import sys

import mink
import mujoco
import numpy as np

DT, GAIN = 0.01, 10.0
FRAMES = {"left_hand": "left_rubber_hand", "right_hand": "right_rubber_hand"}
FRAMES |= {"left_elbow": "left_elbow_link", "right_elbow": "right_elbow_link", "head": "head_link"}
LEG, ARM, FEET = 0.75, 0.62, ("left_ankle_roll_link", "right_ankle_roll_link")


def person(t: float) -> dict[str, np.ndarray]:
    """Key points of a person of 1.8 m who squats and waves with both arms; x ahead, y left, z up [m]."""
    down, wave = 0.1 * (1 - np.cos(t)), np.sin(1.5 * t) * min(t, 1.0)
    pelvis, points = np.array([0.0, 0.02 * np.sin(t), 1.0 - down]), {}
    for side, sign in (("left", 1.0), ("right", -1.0)):
        points[f"{side}_elbow"] = pelvis + [0.05 * wave, sign * 0.25, 0.22]
        points[f"{side}_hand"] = pelvis + [0.3, sign * 0.22 + 0.1 * wave, 0.22 + 0.15 * sign * wave]
    return {"pelvis": pelvis, "head": pelvis + [0.03 * wave, 0.0, 0.65], **points}


spec = mujoco.MjSpec.from_file(sys.argv[1])
# The compiler of a URDF welds links of fixed joints together unless told otherwise, and knows no floating base
spec.compiler.fusestatic = False
spec.worldbody.first_body().add_freejoint()
model = spec.compile()
q = model.qpos0.copy()
for name, value in zip(sys.argv[2::2], sys.argv[3::2], strict=True):
    q[model.joint(name).qposadr[0]] = float(value)
configuration = mink.Configuration(model, q)
tasks = {name: mink.FrameTask(frame, "body", 1.0, 0.0, gain=GAIN * DT) for name, frame in FRAMES.items()}
for side in ("left", "right"):
    tasks[f"{side}_elbow"].set_position_cost(0.1)
tasks["pelvis"] = mink.FrameTask("pelvis", "body", 1.0, 1.0, gain=GAIN * DT)
posture = mink.PostureTask(model, cost=1e-2, gain=DT)
feet = [mink.FrameTask(foot, "body", 1.0, 1.0) for foot in FEET]
for task in (posture, *feet):
    task.set_target_from_configuration(configuration)
limits, first, worst = [mink.ConfigurationLimit(model)], person(0.0), 0.0
home = {
    name: configuration.get_transform_frame_to_world(f, "body") for name, f in {**FRAMES, "pelvis": "pelvis"}.items()
}
for k in range(1200):
    now, soon, places = person(k * DT), person((k + 1) * DT), {}
    for name, pose in home.items():
        # Limbs scale about the pelvis, and the pelvis about the ground
        move, rate = (
            LEG * (a["pelvis"] - b["pelvis"])
            + (ARM * (a[name] - a["pelvis"] - b[name] + b["pelvis"]) if name != "pelvis" else 0.0)
            for a, b in ((now, first), (soon, now))
        )
        places[name] = pose.translation() + move
        # mink has no velocity of a target: what would be fed forward is added to it
        ahead = places[name] + rate / DT / GAIN
        tasks[name].set_target(mink.SE3.from_rotation_and_translation(pose.rotation(), ahead))
    for name in ("left_hand", "right_hand"):
        here = configuration.get_transform_frame_to_world(FRAMES[name], "body").translation()
        worst = max(worst, np.linalg.norm(here - places[name]))
    v = mink.solve_ik(configuration, [*tasks.values(), posture], DT, "daqp", limits=limits, constraints=feet)
    configuration.integrate_inplace(v, DT)

print(f"hands at most {1e3 * worst:.1f} mm from the scaled key points")
if worst > 0.03:
    raise SystemExit("the robot cannot follow this person")
