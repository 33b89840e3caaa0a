"""mink with DAQP, on a MuJoCo model made from the same URDF."""

from __future__ import annotations

import functools
import xml.etree.ElementTree as ET

import mink
import mujoco
import numpy as np

from bench.contender import Contender
from bench.descriptions import mujoco_urdf, solid_name
from bench.problems import Array, Case

#: Spheres farther apart than this give no row [m]; at the rate of the problems such a row never binds
DETECTION = 0.15


class Mink(Contender):
    """``mink.solve_ik`` and ``Configuration.integrate_inplace``; obstacles by its collision limit."""

    def __init__(self, case: Case, detection: float = DETECTION) -> None:
        """Compile the model and build the tasks."""
        super().__init__(case)
        self.detection = detection
        problem = self.problem
        text = case.urdf.read_text()
        spec = mujoco.MjSpec.from_string(mujoco_urdf(text))
        if problem.floating:
            spec.worldbody.first_body().add_freejoint()
        capsules = {solid_name(k) for k, solid in enumerate(problem.solids) if solid.kind == "capsule"}
        for geom in spec.geoms:
            if geom.name in capsules:
                # A URDF has no capsules; radius and half length mean the same in both
                geom.type = mujoco.mjtGeom.mjGEOM_CAPSULE
        self.model = spec.compile()
        self.q0 = np.array(self.model.qpos0)
        self.slots = [int(self.model.joint(name).qposadr[0]) for name in problem.joints]
        if problem.floating:
            self.q0[:3], self.q0[3:7] = case.q0[:3], case.q0[[6, 3, 4, 5]]
        self.q0[self.slots] = case.q0[-len(self.slots) :]
        self.frames = [
            mink.FrameTask(f, "body", position_cost=1.0 / problem.length, orientation_cost=1.0) for f in problem.frames
        ]
        posture = mink.PostureTask(self.model, cost=float(np.sqrt(problem.posture_weight)))
        posture.set_target(self.q0)
        self.com = mink.ComTask(cost=1.0 / problem.length) if problem.com else None
        self.tasks = [*self.frames, posture] + ([self.com] if self.com else [])
        self.limits = [
            mink.ConfigurationLimit(self.model, gain=1.0),
            mink.VelocityLimit(self.model, velocity_limits(text, problem.joints)),
        ]
        if problem.pairs:
            self.limits.append(self._collisions())
        self.reset()

    def _collisions(self) -> mink.CollisionAvoidanceLimit:
        pairs = [([solid_name(a)], [solid_name(b)]) for a, b in self.problem.pairs]
        # mink bounds the displacement of a tick by gain * distance / dt, so a rate costs two factors of dt
        return mink.CollisionAvoidanceLimit(
            self.model,
            pairs,
            gain=self.problem.rate * self.problem.dt**2,
            minimum_distance_from_collisions=self.problem.margin,
            collision_detection_distance=self.detection,
        )

    def reset(self) -> None:
        self.configuration = mink.Configuration(self.model, q=self.q0)

    def aim(self, tick: int) -> None:
        for task, pose in zip(self.frames, self.case.poses[tick], strict=True):
            task.set_target(mink.SE3.from_matrix(pose))
        if self.com:
            self.com.set_target(self.case.com[tick])

    def call(self) -> None:
        velocity = mink.solve_ik(
            self.configuration,
            self.tasks,
            self.problem.dt,
            solver="daqp",
            damping=self.problem.damping,
            limits=self.limits,
        )
        self.configuration.integrate_inplace(velocity, self.problem.dt)

    def state(self) -> Array:
        q = np.array(self.configuration.q)
        base = [q[:3], q[[4, 5, 6, 3]]] if self.problem.floating else []
        return np.concatenate([*base, q[self.slots]])


#: With the distance of its default below which pairs have rows, 1 cm
at_default_detection = functools.partial(Mink, detection=0.01)


def velocity_limits(urdf: str, joints: list[str]) -> dict[str, float]:
    """Velocity limits [rad/s] as the URDF states them; MuJoCo drops them."""
    limits = {}
    for joint in ET.fromstring(urdf).iter("joint"):
        limit = joint.find("limit")
        if joint.get("name") in joints and limit is not None:
            limits[str(joint.get("name"))] = float(limit.get("velocity", "inf"))
    return limits
