"""Three arms walk along a cylinder: plan, controller and simulated robot in a few lines."""

import numpy as np

import wbc
from wbc.walking.run import PathRequest, perform_walk

walker = wbc.robots.walker()
request = PathRequest("cylinder", speed=0.1016, start="13,9", points=("13,14",))
run = perform_walk(request, walker)

for step in run.plan.regrasps:
    print(f"{step.arm}: {step.source} -> {step.target}, lifted after {step.lift:.2f} s")
print(f"{run.outcome} after {run.log.t[-1]:.2f} s, {len(run.plan.regrasps)} re-grasps")

limits = walker.robot.limits.velocity[6:]
print(f"body at most {1e3 * run.ticks.body_error.max():.2f} mm off its command")
print(f"held hands at most {1e3 * run.ticks.slip.max():.4f} mm off their holds")
print(f"largest joint rate {np.abs(run.log.v / limits).max():.6f} of its limit")
