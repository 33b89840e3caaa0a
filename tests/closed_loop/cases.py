"""Every closed-loop check by name, with the class it is about; the compiled loops are kept for a test process."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache, partial

from tests.closed_loop import constraints, tasks
from tests.closed_loop.constraints import constraint_items
from tests.closed_loop.loop import Loop
from tests.closed_loop.machines import machine
from tests.closed_loop.subjects import SUBJECTS, task_items
from wbc.tasks import (
    Damping,
    Fixed,
    FrameVelocityLimit,
    Hold,
    Item,
    JointLimits,
    Obstacle,
    PitchPlane,
    PitchPlaneLimit,
)


@dataclass(frozen=True, eq=False)
class Case:
    """A check of one item: its class, its name in the stack, and what to run."""

    cls: type[Item]
    item: str
    check: Callable[[Loop], dict[str, float]]


#: Tasks that are also run with joint limits
LIMITED = (
    "hand",
    "hand's turn from a moving frame",
    "plane of three points",
    "posture",
    "centre of mass",
    "expression",
)

TASKS: dict[str, Case] = {
    **{f"{name}: decay": Case(s.cls, name, partial(tasks.decay, name=name)) for name, s in SUBJECTS.items()},
    **{f"{name}: tracking": Case(s.cls, name, partial(tasks.tracking, name=name)) for name, s in SUBJECTS.items()},
    **{f"{n}: limits": Case(SUBJECTS[n].cls, n, partial(tasks.within_limits, name=n)) for n in LIMITED},
    "damping": Case(Damping, "damping", tasks.damping),
    "rate of the plane": Case(PitchPlane, "rate of the plane", tasks.plane_rate),
}

CONSTRAINTS: dict[str, Case] = {
    **{
        f"{name}, {'moving' if moving else 'at rest'}": Case(
            Obstacle, name, partial(constraints.obstacle, name=name, moving=moving)
        )
        for name in ("ball", "wall")
        for moving in (False, True)
    },
    **{
        name: Case(FrameVelocityLimit, name, partial(constraints.frame_speed, name=name))
        for name in ("speed, own axes", "speed from a moving frame")
    },
    "hold": Case(Hold, "hold", constraints.hold),
    "fixed": Case(Fixed, "fixed", constraints.fixed),
    "limits": Case(JointLimits, "limits", constraints.joint_limits),
    "plane limit": Case(PitchPlaneLimit, "plane limit", constraints.plane_limit),
}


@cache
def task_loop(name: str) -> Loop:
    """The stack of all tasks on a robot."""
    return Loop(machine(name), task_items(name, machine(name)), tasks.DT, name)


@cache
def constraint_loop(name: str) -> Loop:
    """The stack of all constraints on a robot, with tasks that pull against them."""
    return Loop(machine(name), constraint_items(name, machine(name)), constraints.DT, name)
