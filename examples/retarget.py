"""A person's key points drive a G1: scaled limb by limb, with the speeds of the points fed forward, on held feet."""

import numpy as np

import wbc

# Key point -> (frame of the robot, length of the robot's limb over the person's)
FRAMES = {"left_hand": "left_rubber_hand", "right_hand": "right_rubber_hand"}
FRAMES |= {"left_elbow": "left_elbow_link", "right_elbow": "right_elbow_link", "head": "head_link"}
LEG, ARM = 0.75, 0.62


def person(t: float) -> dict[str, np.ndarray]:
    """Key points of a person of 1.8 m who squats and waves with both arms; x ahead, y left, z up [m]."""
    down, wave = 0.1 * (1 - np.cos(t)), np.sin(1.5 * t) * min(t, 1.0)
    pelvis, points = np.array([0.0, 0.02 * np.sin(t), 1.0 - down]), {}
    for side, sign in (("left", 1.0), ("right", -1.0)):
        points[f"{side}_elbow"] = pelvis + [0.05 * wave, sign * 0.25, 0.22]
        points[f"{side}_hand"] = pelvis + [0.3, sign * 0.22 + 0.1 * wave, 0.22 + 0.15 * sign * wave]
    return {"pelvis": pelvis, "head": pelvis + [0.03 * wave, 0.0, 0.65], **points}


robot = wbc.robots.load("g1", shapes="none")
stack = wbc.Stack(robot, dt=0.01)
stack.add(wbc.tasks.Hold("left_ankle_roll_link"), name="left foot")
stack.add(wbc.tasks.Hold("right_ankle_roll_link"), name="right foot")
stack.add(wbc.tasks.EndEffector("pelvis", gain=10.0), name="pelvis")
for point, frame in FRAMES.items():
    weight = 0.01 if "elbow" in point else 1.0
    stack.add(wbc.tasks.EndEffector(frame, kind="position", gain=10.0), name=point, weight=weight)
stack.add(wbc.tasks.Posture(), name="posture", weight=1e-4)
stack.add(wbc.tasks.JointLimits())
controller = stack.compile()

q, first, worst = robot.neutral, person(0.0), 0.0
home = {name: robot.pose(q, frame) for name, frame in {**FRAMES, "pelvis": "pelvis"}.items()}
for k in range(1200):
    now, soon = person(k * stack.dt), person((k + 1) * stack.dt)
    for name, pose in home.items():
        # Limbs scale about the pelvis, and the pelvis about the ground
        move, rate = (
            LEG * (a["pelvis"] - b["pelvis"])
            + (ARM * (a[name] - a["pelvis"] - b[name] + b["pelvis"]) if name != "pelvis" else 0.0)
            for a, b in ((now, first), (soon, now))
        )
        place, speed = pose.translation + move, rate / stack.dt
        if name == "pelvis":
            controller[name].set(target=(place, pose.rotation), feedforward=[*speed, 0.0, 0.0, 0.0])
        else:
            controller[name].set(target=place, feedforward=speed)
    step = controller.step(q)
    q = robot.integrate(q, step.v, stack.dt)
    worst = max(worst, *(step.residuals[name].norm("m") for name in ("left_hand", "right_hand")))

print(f"{step.status}: hands at most {1e3 * worst:.1f} mm from the scaled key points")
if worst > 0.03:
    raise SystemExit("the robot cannot follow this person")
