"""Walks under torques from seeds: random machines, grounds, courses, gravities, loads, motors, encoders and faults."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from itertools import pairwise
from math import pi, sin
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin

import wbc
from tests.walking.trials.second_checker import second_check
from tests.walking.trials.structures import FAMILIES, random_structure
from wbc.motion_control import loaded
from wbc.robots import Walker
from wbc.simulation import Encoders, GripKind, GrippingMujocoPlant, Motors, PinocchioPlant
from wbc.validation import Array
from wbc.walking import Structure, save_structure
from wbc.walking.checker import Report, check_walk
from wbc.walking.log.log import WalkLog
from wbc.walking.report.folder import rules_of, save_run
from wbc.walking.run.request import PathRequest, Site
from wbc.walking.run.session import perform_walk
from wbc.walking.torque.choice import hold_kind_of
from wbc.walking.torque.faults import Fault
from wbc.walking.torque.loop import TorqueLoop
from wbc.walking.torque.stack import TorqueStack
from wbc.walking.torque.tested import Tested

Record = dict[str, Any]

#: Body and necks are within this beyond the shoulders [m]
NECK = 0.105
#: Where a walk goes on built-in structures: between two of these
GROUNDS = {
    "cylinder": ("13,6", "13,9", "13,12", "10,9", "16,9"),
    "plane": ("8,6", "8,9", "8,13", "5,9", "11,9"),
    "truss": ("L2,6", "L2,10", "L2,14"),
    "module": ("15,4", "15,7", "15,10"),
}
#: Part of trials on these, and not on random structures
BUILT_IN = 0.7
#: How many arms, drawn with equal chances, and the largest gravity that is drawn for them [m/s^2]
ARMS = {3: 0.9, 4: 1.5, 5: 2.0}
#: Largest payload [kg], friction [N m; N m s], noise of encoders [rad], of which that of rates is 100 times in 1/s, ...
PAYLOAD, FRICTION, NOISE = 40.0, 3.0, 1e-5
#: ... delay [ms], and slip of a grip [m]
DELAY, SLIP = 20, 0.002


@dataclass(frozen=True)
class Draw:
    """What is tried: gravity along the structure's axes [m/s^2], payload on the body that the loop does not know [kg],
    friction that it does not know, viscous and Coulomb's [N m s, N m], noise of encoders, which it knows [rad].
    """

    arms: int
    plant: str
    ground: str
    start: str
    goal: str
    speed: float
    gravity: tuple[float, float, float] = (0.0, 0.0, 0.0)
    payload: float = 0.0
    friction: float = 0.0
    noise: float = 0.0
    delay: float = 0.0
    fault: str = ""

    @classmethod
    def of(cls, seed: int, folder: Path, body: float) -> Draw:
        """That of a seed; a random structure is left in the folder.

        Args:
            body: radius about the body's axis within which a machine with three arms is [m].
        """
        rng = np.random.default_rng([4, seed])
        arms = int(rng.choice(list(ARMS)))
        plant = str(rng.choice(["pinocchio", "pinocchio", "mujoco"]))
        if rng.random() < BUILT_IN:
            ground = str(rng.choice(list(GROUNDS)))
            start, goal = map(str, rng.choice(GROUNDS[ground], 2, replace=False))
        else:
            trial = random_structure(str(rng.choice(list(FAMILIES))), seed, body)
            holds = tuple(replace(hold, max_tilt=0.0) for hold in trial.structure.holds)
            rigid = Structure(trial.structure.name, holds, trial.structure.obstacles, trial.structure.surface)
            folder.mkdir(parents=True, exist_ok=True)
            ground, start, goal = str(save_structure(rigid, folder / "ground.csv")), trial.start, trial.goal
        drawn = cls(arms, plant, ground, start, goal, round(float(rng.uniform(0.05, 0.12)), 3))
        way = rng.standard_normal(3)
        gravity = way / np.linalg.norm(way) * rng.uniform(0.0, ARMS[arms])
        fault = str(rng.choice(["slip", "limp", "break"]))
        arm, time = f"arm{rng.integers(1, arms + 1)}", f"{rng.uniform(0.5, 8.0):.2f}"
        text = {
            "slip": f"slip {arm} {rng.uniform(0.0, SLIP):.4f} at {time}",
            "limp": f"limp {arm}_joint{rng.integers(1, 7)} at {time}",
            "break": f"break {arm} at {time}",
        }[fault]
        # Each of these is there in a part of the trials, so that many are nearly plain
        given: dict[str, Any] = {
            "gravity": tuple(round(float(g), 3) for g in gravity),
            "payload": round(float(rng.uniform(0.0, PAYLOAD)), 1),
            "friction": round(float(rng.uniform(0.0, FRICTION)), 2),
            "noise": float(f"{NOISE * 10.0 ** rng.uniform(-2.0, 0.0):.2g}") if plant == "pinocchio" else 0.0,
            "delay": 1e-3 * int(rng.integers(1, DELAY + 1)),
            "fault": text,
        }
        there = rng.random(len(given)) < (0.5, 0.3, 0.3, 0.3, 0.2, 0.3)
        return replace(drawn, **{name: value for (name, value), one in zip(given.items(), there, strict=True) if one})

    @property
    def words(self) -> str:
        """All that is not as usual."""
        return ", ".join(
            f"{f.name} {getattr(self, f.name)}" for f in fields(self) if getattr(self, f.name) != f.default
        )

    def loop(self, walker: Walker, structure: Structure) -> Witness:
        """The simulated machine with the loop of torques over it."""
        motors = Motors(viscous=self.friction, coulomb=self.friction, delay=self.delay)
        encoders = Encoders(position=self.noise, velocity=100.0 * self.noise) if self.noise else None
        faults = [Fault.read(self.fault)] if self.fault else []
        return witnessed(walker, structure, self.plant, self.gravity, self.payload, motors, encoders, faults)


class Witness(TorqueLoop):
    """Keeps where the robot really was at the end of every period: the log has what was read."""

    def reset(self, q: Array, time: float) -> None:
        """See :class:`TorqueLoop`."""
        super().reset(q, time)
        self.places = [np.array(q)]

    def advance(self, dt: float) -> None:
        """See :class:`TorqueLoop`."""
        super().advance(dt)
        self.places.append(np.array(self.plant.state.q))  # type: ignore[attr-defined]

    def truth(self, log: WalkLog) -> WalkLog:
        """The log as it was: mean rates over each period."""
        q = np.array(self.places)[: len(log)]
        moved = np.array([pin.difference(self._model, a, b) for a, b in pairwise(q)]) / log.dt
        rates = np.vstack([moved, moved[-1:]])
        order = [self._model.joints[self._model.getJointId(name)].idx_q for name in log.joints]
        columns = [self._model.joints[self._model.getJointId(name)].idx_v for name in log.joints]
        return replace(log, q=q[:, order], v=rates[:, columns], pose_body_in_structure=q[:, :7],
                       twist_body=rates[:, :6])  # fmt: skip


def witnessed(
    walker: Walker,
    structure: Structure,
    plant: str,
    gravity: tuple[float, float, float] = (0.0, 0.0, 0.0),
    payload: float = 0.0,
    motors: Motors | None = None,
    encoders: Encoders | None = None,
    faults: Sequence[Fault] = (),
) -> Witness:
    """A loop of torques that keeps where the robot was, over a simulated machine: pinocchio or mujoco.

    Args:
        payload: on the body [kg], and friction of the motors: the loop does not know them. It knows the motors' delay
            and the encoders' noise.
    """
    motors, heavy = motors or Motors(), wbc.robots.with_masses(walker, gravity)
    robot = loaded(heavy.robot, payload, frame="body")
    simulated: Tested
    if plant == "mujoco":
        simulated = GrippingMujocoPlant(robot, [arm.hand for arm in heavy.arms], motors=motors)
    else:
        simulated = PinocchioPlant(robot, integrator="midpoint", motors=motors, encoders=encoders)
    stack = TorqueStack(heavy, [GripKind(hold_kind_of(structure, k)) for k in range(len(structure))])
    return Witness(stack, simulated, delay=motors.delay, encoders=encoders, faults=faults)


def torque(name: str, walker: Walker, folder: Path) -> dict[str, Any]:
    """A walk under torques; ``SEED``. The checkers judge where the robot was, and what was read of it."""
    draw = Draw.of(int(name), folder, walker.arm_data.shoulder_radius + NECK)
    machine = walker_of(draw.arms)
    request = PathRequest(Site(draw.ground, rigid=draw.ground in GROUNDS), draw.start, (draw.goal,), draw.speed, 0.1)
    loop = draw.loop(machine, request.site.build())
    run = perform_walk(request, machine, plant=loop)
    out = {"draw": draw.words, "outcome": run.outcome, "reason": run.reason, "plan_s": run.plan_time}
    save_run(run, folder, check=False)
    if run.log is None:
        return out
    urdf, watch = machine.urdf(folder / "robot.urdf"), loop.watch
    true = loop.truth(run.log)
    out |= {
        "walk_s": float(run.log.t[-1]),
        "noted": [f"{text} at {time:.2f} s" for time, text in watch.noted],
        "drift": watch.drift,
        "wrench": [watch.force, watch.moment],
        "unsolved": watch.unsolved,
        "violations": violations(check_walk(true, urdf, run.structure, rules_of(machine))),
        "read": violations(check_walk(run.log, urdf, run.structure, rules_of(machine))),
    }
    true.save(folder / "true.npz")
    return out | {"second": second_check(folder / "true.npz", machine, urdf, run.structure)}


def violations(report: Report) -> list[str]:
    """In words."""
    return [f"{f.kind}: {f.worst:.4g} at {f.time:.2f} s, {f.where}" for f in report.violations]


def walker_of(arms: int) -> Walker:
    """A walker whose arms are as far from each other as three of them, as ``wbc walk --arms`` has it."""
    three = wbc.robots.walker()
    if arms <= 3:
        return wbc.robots.walker(arms)
    return wbc.robots.walker(arms, three.data.shoulder_radius * sin(pi / 3) / sin(pi / arms))
