"""A Panda that is commanded by torque wipes a table: 10 N down, a circle along it, friction known beforehand."""

import numpy as np
import pinocchio as pin

import wbc

DT, SUBSTEPS, TIP = 0.002, 4, "panda_hand_tcp"
PRESS, RUB, SLOW = 10.0, 0.3, 0.01  # N, coefficient of friction, m/s
STIFF, DAMPED = 5e4, 200.0  # the table, N/m and N s/m
RADIUS, TURN = 0.04, 2.0  # circle, m and rad/s

robot = wbc.robots.load("panda")
stack = wbc.Stack(robot, dt=DT)
stack.add(wbc.tasks.EndEffector(TIP, weights=(1, 1, 0, 1, 1, 1), gain=20.0), name="hand")
stack.add(wbc.tasks.SlidingContact(TIP, friction=RUB, slow=SLOW), name="wiper")
stack.add(wbc.tasks.Posture(), weight=1e-2).add(wbc.tasks.JointLimits()).add(wbc.tasks.TorqueLimits())


def simulate(seconds: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Normal forces [N], errors of the hand along the table [m] and shares of torque limits, tick by tick."""
    model, data, q, v = robot.model, robot.model.createData(), robot.neutral, np.zeros(robot.nv)
    tip = model.getFrameId(TIP)
    pin.framesForwardKinematics(model, data, q)
    start = data.oMf[tip].copy()
    center, out = start.translation - [RADIUS, 0.0, 0.0], []
    controller = stack.compile(command="torque")
    controller.reset(q)
    controller["wiper"].target = pin.SE3(np.eye(3), start.translation)
    controller["wiper force"].target = [PRESS]
    controller["wiper force"].weight = 10.0
    for k in range(round(seconds / DT)):
        # at rest at the beginning: the angle and its two derivatives
        t = k * DT
        angle, rate, change = TURN * (t - np.sin(t)), TURN * (1 - np.cos(t)), TURN * np.sin(t)
        out_of, along = np.array([np.cos(angle), np.sin(angle), 0.0]), np.array([-np.sin(angle), np.cos(angle), 0.0])
        goal, still = center + RADIUS * out_of, np.zeros(3)
        controller["hand"].set(
            target=pin.SE3(start.rotation, goal),
            feedforward=np.r_[RADIUS * rate * along, still],
            acceleration=np.r_[RADIUS * (change * along - rate**2 * out_of), still],
        )
        torque = controller.step(q, v).torque
        for _ in range(SUBSTEPS):
            J = pin.computeFrameJacobian(model, data, q, tip, pin.LOCAL_WORLD_ALIGNED)[:3]
            pin.updateFramePlacement(model, data, tip)
            slip, depth = J @ v, start.translation[2] - data.oMf[tip].translation[2]
            press = max(0.0, STIFF * depth - DAMPED * slip[2]) if depth > 0.0 else 0.0
            force = press * np.r_[-RUB * slip[:2] / np.sqrt(slip[:2] @ slip[:2] + SLOW**2), 1.0]
            v = v + pin.aba(model, data, q, v, torque + J.T @ force) * (DT / SUBSTEPS)
            q = pin.integrate(model, q, v * (DT / SUBSTEPS))
        error = float(np.linalg.norm((data.oMf[tip].translation - goal)[:2]))
        out.append((press, error, float(np.max(np.abs(torque) / robot.limits.effort))))
    forces, errors, shares = np.array(out).T
    return forces, errors, shares


if __name__ == "__main__":
    forces, errors, shares = simulate(3.0)
    settled = slice(len(forces) // 4, None)
    print(f"force {forces[settled].mean():.2f} N, from {forces[settled].min():.2f} to {forces[settled].max():.2f} N")
    print(f"largest error along the table {1e3 * errors[settled].max():.2f} mm")
    print(f"largest torque {100 * shares.max():.0f} % of its limit")
