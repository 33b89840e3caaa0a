"""Stances: which limb is at which foothold, and a configuration of the robot there."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from wbc.validation import Array

#: In :attr:`Stance.contacts`: a limb that holds nothing
FREE_LIMB = -1


@dataclass(frozen=True, eq=False)
class Stance:
    """Limbs at footholds, and a configuration in which they are there.

    Attributes:
        contacts: for each limb of the climber the row of its foothold in the scene, or ``FREE_LIMB``.
        q: configuration ``(nq)`` [m, rad].
    """

    contacts: tuple[int, ...]
    q: Array


@dataclass(frozen=True, eq=False)
class StancePath:
    """Stances one after another: from one to the next, limbs whose foothold is the same in both keep it and bear the
    robot; every other limb is in the air between them, and the body moves as well.

    Attributes:
        stances: two or more; the first is where the robot stands.
        margins: of each stance the lower margin of the limbs that stay, in it and in the one before, as
            :class:`wbc.climb.Equilibrium` states it; of the first that of all its contacts.
    """

    stances: Sequence[Stance]
    margins: Array
