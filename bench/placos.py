"""placo's kinematics solver."""

from __future__ import annotations

import json

import numpy as np
import placo

from bench.contender import Contender
from bench.descriptions import solid_index
from bench.problems import Array, Case

#: Spheres farther apart than this give no row [m]
TRIGGER = 0.15


class Placo(Contender):
    """``RobotWrapper.update_kinematics`` and ``KinematicsSolver.solve(True)``.

    Obstacles are links that are fixed in the world, avoided by its self-collision constraint, which has no rate:
    a distance may shrink to the margin within one tick.
    """

    def __init__(self, case: Case) -> None:
        """Load the robot and build the solver."""
        super().__init__(case)
        problem = self.problem
        self.robot = placo.RobotWrapper(str(case.urdf))
        expected = ["root_joint", *problem.joints]
        assert list(self.robot.model.names)[1:] == expected, list(self.robot.model.names)
        if problem.pairs:
            self._load_pairs()
        self.reset()
        self.solver = placo.KinematicsSolver(self.robot)
        self.solver.dt = problem.dt
        self.solver.mask_fbase(not problem.floating)
        self.solver.enable_joint_limits(True)
        self.solver.enable_velocity_limits(True)
        self.frames = []
        for frame in problem.frames:
            task = self.solver.add_frame_task(frame, np.eye(4))
            task.configure(frame, "soft", 1.0 / problem.length**2, 1.0)
            self.frames.append(task)
        posture = self.solver.add_joints_task()
        posture.set_joints(dict(zip(problem.joints, case.q0[-len(problem.joints) :].tolist(), strict=True)))
        posture.configure("posture", "soft", problem.posture_weight)
        self.com = None
        if problem.com:
            self.com = self.solver.add_com_task(case.com[0])
            self.com.configure("com", "soft", 1.0 / problem.length**2)
        self.solver.add_regularization_task(problem.damping)
        if problem.pairs:
            avoid = self.solver.add_avoid_self_collisions_constraint()
            avoid.self_collisions_margin = problem.margin
            avoid.self_collisions_trigger = TRIGGER
            avoid.configure("obstacles", "hard")
        self.reset()

    def _load_pairs(self) -> None:
        names = [g.name for g in self.robot.collision_model.geometryObjects]
        solids = [names.index(solid_index(self.problem.solids, k)) for k in range(len(self.problem.solids))]
        pairs = [[solids[a], solids[b]] for a, b in self.problem.pairs]
        file = self.case.urdf.with_name("placo_pairs.json")
        file.write_text(json.dumps(pairs))
        self.robot.load_collision_pairs(str(file))

    def reset(self) -> None:
        base = [] if self.problem.floating else [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0]
        self.robot.state.q = np.concatenate([base, self.case.q0])
        self.robot.update_kinematics()

    def aim(self, tick: int) -> None:
        for task, pose in zip(self.frames, self.case.poses[tick], strict=True):
            task.T_world_frame = pose
        if self.com is not None:
            self.com.target_world = self.case.com[tick]

    def call(self) -> None:
        self.robot.update_kinematics()
        self.solver.solve(True)

    def state(self) -> Array:
        q = np.array(self.robot.state.q)
        return q if self.problem.floating else q[7:]
