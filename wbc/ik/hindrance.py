"""What keeps a search from its goals: the constraints, one of them, or the robot itself."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from wbc.ik.solution import Solution
from wbc.tasks.mechanism import Mechanism
from wbc.tasks.moving_frame import MovingFrame

if TYPE_CHECKING:
    from wbc.ik.inverse_kinematics import InverseKinematics


@dataclass(frozen=True)
class Hindrance:
    """``alone``: the constraints without any one of which the goals were met. ``together``: all of them, where without
    them all the goals were met. ``nearest``: the search without any constraint, where even that met no goal.
    """

    alone: tuple[str, ...] = ()
    together: tuple[str, ...] = ()
    nearest: Solution | None = None

    @property
    def out_of_reach(self) -> bool:
        """No constraint is to blame."""
        return self.nearest is not None


def hindrance(kinematics: InverseKinematics, q0: Any, **options: Any) -> Hindrance:
    """Search again without the constraints, all at once and then one at a time; they are on again afterwards.

    Args:
        options: of :meth:`InverseKinematics.solve`; the budget is that of each of these searches.
    """
    entries = kinematics.stack.constraints
    names = [e.name for e in entries if not isinstance(e.item, (Mechanism, MovingFrame)) and kinematics[e.name].enabled]
    free = _without(kinematics, names, q0, options)
    if not free.solved:
        return Hindrance(nearest=free)
    if len(names) == 1:
        return Hindrance(alone=tuple(names))
    alone = tuple(name for name in names if _without(kinematics, [name], q0, options).solved)
    return Hindrance(alone=alone) if alone else Hindrance(together=tuple(names))


def _without(kinematics: InverseKinematics, names: list[str], q0: Any, options: dict[str, Any]) -> Solution:
    masks = {name: kinematics[name].mask for name in names}
    for name in names:
        kinematics[name].enabled = False
    try:
        return kinematics.solve(q0, **options)
    finally:
        for name, mask in masks.items():
            kinematics[name].enabled = True
            kinematics[name].mask = mask
