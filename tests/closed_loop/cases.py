"""Every closed-loop check by name: the class that it is about, its stack, and the robots that it is run on."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache, partial
from itertools import chain

from tests.closed_loop import (
    collisions,
    constraints,
    couplings,
    dexterity,
    hands,
    limits,
    mechanism,
    pointing,
    rolling,
    subjects,
    tasks,
)
from tests.closed_loop.loop import Loop
from tests.closed_loop.machines import CONSTRAINT_ROBOTS, TASK_ROBOTS
from tests.closed_loop.subjects import Subject
from tests.repeats import covering
from tests.wheels import VEHICLES
from wbc.tasks import (
    Damping,
    Fixed,
    FrameVelocityLimit,
    Hold,
    Item,
    JointLimits,
    Manipulability,
    Mechanism,
    Momentum,
    Obstacle,
    PitchPlane,
    PitchPlaneLimit,
    Rolling,
    SelfCollision,
)

#: The class that a check is about, and the check, which returns its figures and asserts what the class promises
Check = tuple[type[Item], Callable[[Loop], Mapping[str, float]]]


@dataclass(frozen=True, eq=False)
class Group:
    """Items that share a stack, built once a robot in a test process, and checks that take turns on the robots."""

    build: Callable[[str], Loop]
    robots: tuple[str, ...]
    checks: dict[str, Check]


def followed(known: Mapping[str, Subject]) -> dict[str, Check]:
    """Decay of every subject's error, and a target that moves."""
    return {
        f"{name}: {check.__name__}": (s.cls, partial(check, name=name, subjects=known))
        for name, s in known.items()
        for check in (tasks.decay, tasks.tracking)
    }


#: Tasks that are also run with joint limits
LIMITED = (
    "hand",
    "hand's turn from a moving frame",
    "plane of three points",
    "posture",
    "centre of mass",
    "expression",
)

GROUPS: dict[str, Group] = {
    "tasks": Group(
        tasks.build,
        TASK_ROBOTS,
        {
            **followed(subjects.SUBJECTS),
            **{f"{n}: limits": (subjects.SUBJECTS[n].cls, partial(tasks.within_limits, name=n)) for n in LIMITED},
            "damping": (Damping, tasks.damping),
            "rate of the plane": (PitchPlane, tasks.plane_rate),
        },
    ),
    "constraints": Group(
        constraints.build,
        CONSTRAINT_ROBOTS,
        {
            **{
                f"{name}, {'moving' if moving else 'at rest'}": (
                    Obstacle,
                    partial(constraints.obstacle, name=name, moving=moving),
                )
                for name in ("ball", "wall")
                for moving in (False, True)
            },
            **{
                name: (FrameVelocityLimit, partial(constraints.frame_speed, name=name))
                for name in ("speed, own axes", "speed from a moving frame")
            },
            "hold": (Hold, constraints.hold),
            "fixed": (Fixed, constraints.fixed),
            "limits": (JointLimits, constraints.joint_limits),
            "plane limit": (PitchPlaneLimit, constraints.plane_limit),
        },
    ),
    "pointing": Group(
        pointing.build,
        TASK_ROBOTS,
        {
            **followed(pointing.SUBJECTS),
            # These fall in size, not on a straight line
            **{f"{n}: decay": (pointing.SUBJECTS[n].cls, partial(pointing.size_decay, name=n)) for n in pointing.SIZES},
            "axis: opposite": (pointing.SUBJECTS["axis"].cls, pointing.opposite),
            "distance from a moving point": (pointing.SUBJECTS["distance from a point"].cls, pointing.moving_point),
            **{name: (Momentum, partial(pointing.momentum, name=name)) for name in pointing.MOMENTA},
        },
    ),
    "two hands": Group(hands.build, hands.ROBOTS, followed(hands.SUBJECTS)),
    "coupled joints": Group(couplings.build, TASK_ROBOTS, followed(couplings.SUBJECTS)),
    "manipulability": Group(
        dexterity.build,
        TASK_ROBOTS,
        {
            name: check
            for name, check in followed(dexterity.SUBJECTS).items()
            if name != "poses, log: tracking"  # as of positions
        },
    ),
    "greatest manipulability": Group(
        dexterity.build, TASK_ROBOTS, {"climb": (Manipulability, partial(dexterity.climb, name="positions"))}
    ),
    "wheels": Group(rolling.build, VEHICLES, {"roll": (Rolling, rolling.roll)}),
    "mechanism": Group(mechanism.build, mechanism.ROBOTS, {"mechanism": (Mechanism, mechanism.mechanism)}),
    "limits": Group(
        limits.build,
        CONSTRAINT_ROBOTS,
        {name: (guard.cls, partial(limits.check, name=name)) for name, guard in limits.GUARDS.items()},
    ),
    "collisions": Group(
        collisions.build,
        CONSTRAINT_ROBOTS,
        {
            **{name: (Obstacle, partial(collisions.pressed, name=name)) for name in collisions.THINGS},
            **{name: (SelfCollision, partial(collisions.folded, name=name)) for name in collisions.SELF},
        },
    ),
}

#: Every check at least once, and every robot: (group, check, robot)
RUNS = list(
    chain.from_iterable(
        [(name, check, robot) for check, robot in covering(group.checks, group.robots)]
        for name, group in GROUPS.items()
    )
)


@cache
def loop(build: Callable[[str], Loop], robot: str) -> Loop:
    """The stack of a group on a robot."""
    return build(robot)
