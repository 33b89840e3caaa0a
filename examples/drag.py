"""A Panda in the browser: drag its hand's target with the mouse; the arm follows within its limits."""

import sys

import wbc

robot = wbc.robots.load("panda")
stack = wbc.Stack(robot, dt=0.01)
stack.add(wbc.tasks.EndEffector("panda_hand_tcp", gain=5.0), name="hand")
stack.add(wbc.tasks.Posture(), name="posture", weight=1e-4)
stack.add(wbc.tasks.JointLimits())
controller = stack.compile()

# --ticks N: so many ticks without a browser
q, ticks = robot.neutral, int(sys.argv[2]) if "--ticks" in sys.argv else None
with wbc.viewer.show(controller, open_browser=ticks is None) as viewer:
    print(viewer.url)
    while viewer.running and (ticks is None or ticks > 0):
        step = controller.step(q)
        viewer.update(step)
        q = robot.integrate(q, step.v, stack.dt)
        ticks = ticks and ticks - 1
    print(f"{step.status}: hand {1e3 * step.residuals['hand'].norm('m'):.2f} mm from its target")
