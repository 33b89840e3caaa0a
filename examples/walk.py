"""Three arms walk along a cylinder: plan, controller, simulated robot and check in a few lines."""

import numpy as np

from wbc.climb import BodyTrack, ClimbLoop, body_frames, cylinder_grid, machines, plan_along
from wbc.climb.checker import check

walker, scene = machines.climber("walker"), cylinder_grid()
track = BodyTrack(body_frames(walker, scene, ["13,9", "13,14"]), speed=0.1016)
plan = plan_along(walker, scene, track)
for move in plan.moves:
    source, target = (scene.footholds[row].id for row in (move.leaves, move.lands))
    print(f"{walker.limbs[move.limb].name}: {source} -> {target}, lifted after {move.lift:.2f} s")

run = ClimbLoop(plan).run()
t, q, v = run.log["t"], run.log.array("q"), run.log.array("v")
print(f"{run.outcome} after {t[-1]:.2f} s, {len(plan.moves)} re-grasps")
print(check(run.log, walker, scene))
speed = np.linalg.norm(np.diff(q[:, :3], axis=0), axis=1) / np.diff(t)
print(f"body at most {1e3 * speed.max():.1f} mm/s")
print(f"largest joint rate {np.abs(v / walker.robot.limits.velocity)[:, 6:].max():.6f} of its limit")
