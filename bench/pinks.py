"""pink, with the QP solver that is asked for."""

from __future__ import annotations

import functools

import numpy as np
import pink
import pinocchio as pin

from bench.contender import Contender
from bench.descriptions import solid_index
from bench.problems import Array, Case


class Pink(Contender):
    """``pink.solve_ik`` and ``Configuration.integrate_inplace``; obstacles by its collision barrier."""

    def __init__(self, case: Case, solver: str) -> None:
        """Build the tasks; ``solver`` is a name that qpsolvers knows."""
        super().__init__(case)
        self.solver = solver
        problem = self.problem
        root = (pin.JointModelFreeFlyer(),) if problem.floating else ()
        self.model = pin.buildModelFromUrdf(str(case.urdf), *root)
        expected = (["root_joint"] if problem.floating else []) + problem.joints
        assert list(self.model.names)[1:] == expected, list(self.model.names)
        self.frames = [
            pink.FrameTask(f, position_cost=1.0 / problem.length, orientation_cost=1.0) for f in problem.frames
        ]
        posture = pink.PostureTask(cost=np.sqrt(problem.posture_weight))
        posture.set_target(case.q0)
        self.com = pink.tasks.ComTask(cost=1.0 / problem.length) if problem.com else None
        self.tasks = [*self.frames, posture] + ([self.com] if self.com else [])
        self.limits = [
            pink.limits.ConfigurationLimit(self.model, config_limit_gain=1.0),
            pink.limits.VelocityLimit(self.model),
        ]
        self.barriers = [self._barrier()] if problem.pairs else []
        self.reset()

    def _barrier(self) -> pink.barriers.SelfCollisionBarrier:
        geometry = pin.buildGeomFromUrdf(self.model, str(self.case.urdf), pin.GeometryType.COLLISION)
        names = [g.name for g in geometry.geometryObjects]
        solids = [names.index(solid_index(self.problem.solids, k)) for k in range(len(self.problem.solids))]
        for a, b in self.problem.pairs:
            geometry.addCollisionPair(pin.CollisionPair(solids[a], solids[b]))
        self.geometry = geometry
        pairs = min(len(geometry.collisionPairs), self.problem.sensed or np.inf)
        return pink.barriers.SelfCollisionBarrier(
            int(pairs), gain=self.problem.rate, safe_displacement_gain=0.0, d_min=self.problem.margin
        )

    def reset(self) -> None:
        collision = {}
        if self.problem.pairs:
            collision = {"collision_model": self.geometry, "collision_data": pin.GeometryData(self.geometry)}
        self.configuration = pink.Configuration(self.model, self.model.createData(), self.case.q0, **collision)

    def aim(self, tick: int) -> None:
        for task, pose in zip(self.frames, self.case.poses[tick], strict=True):
            task.set_target(pin.SE3(pose))
        if self.com:
            self.com.set_target(self.case.com[tick])

    def call(self) -> None:
        velocity = pink.solve_ik(
            self.configuration,
            self.tasks,
            self.problem.dt,
            solver=self.solver,
            damping=self.problem.damping,
            limits=self.limits,
            barriers=self.barriers,
        )
        self.configuration.integrate_inplace(velocity, self.problem.dt)

    def state(self) -> Array:
        return np.array(self.configuration.q)


with_daqp = functools.partial(Pink, solver="daqp")
