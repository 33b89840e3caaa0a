"""Tani's bilateral recursion of master and slave, with what a moving table adds."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wbc import validation
from wbc.errors import RangeError
from wbc.validation import Array


@dataclass(frozen=True)
class MasterSlave:
    """Each arm goes a part A of the way to the other, and on by a part B of its last two cycles' motion (HICOM):

        slave'  = A master + (1 - A) e + B (e - e_2) + X,   e = slave - X_1 (X: table now, X_1: as it was applied)
        master' = A e + (1 - A) master + B (master - master_2)

    The sum of both follows (z - 1)(z^2 - B z - B), their difference z^3 - (1 - 2 A + B) z^2 + B. No mode grows, and
    the sum comes to rest, where 0 < A < 1 and 0 <= B < 1/2; at B = 1/2 the sum has a double root at 1 and drifts off.

    With a backlash b an arm x moves only where its drive y has taken up the play, x' = y' - clip(y' - x, -b/2, b/2),
    and positions in the recursion are those of the arms. Arms that meet are then left apart by b / (2 A) at most: of
    less than that a part A moves no drive out of its play.

    Raises:
        RangeError: A or B breaks this; nothing has moved.
    """

    A: float = 0.7
    B: float = 0.4

    def __post_init__(self) -> None:
        for name, value, high, mode in (("A", self.A, 1.0, "difference"), ("B", self.B, 0.5, "sum")):
            number = validation.real_array(name, value, ())
            if not 0.0 <= number < high or (name == "A" and number == 0.0):
                left = "(" if name == "A" else "["
                grown = max(abs(x) for x in self.modes(mode)) if np.isfinite(number) else np.inf
                raise RangeError(
                    name, value, f"expected a value in {left}0, {high:g}): modes of the {mode} reach {grown:.5g}"
                )

    def modes(self, which: str) -> Array:
        """Roots z of the ``sum`` or of the ``difference`` of both arms."""
        if validation.one_of("which", which, ("sum", "difference")) == "sum":
            return np.asarray(np.roots([1.0, -1.0 - self.B, 0.0, self.B]))
        return np.asarray(np.roots([1.0, 2.0 * self.A - self.B - 1.0, 0.0, self.B]))

    def run(self, master: Array, slave: Array, table: Array, backlash: float = 0.0) -> tuple[Array, Array]:
        """Both arms cycle by cycle.

        Args:
            master, slave: where they begin, at rest in the middle of their play [n]; the slave on a table at 0.
            table: its displacement [cycles, n].
            backlash: b of both arms, in the unit of n. Default: each arm is where it was sent.

        Returns:
            Master and slave [cycles + 1, n].

        Raises:
            ShapeError, NotFiniteError, RangeError: bad input, a negative backlash.
        """
        play = 0.5 * validation.scalar("backlash", backlash, low=0.0)
        master = validation.ordinary_array("master", master)
        shape = master.shape
        slave = validation.ordinary_array("slave", slave, shape)
        table = validation.ordinary_array("table", table, (len(table), *shape))
        masters, relative = [master] * 3, [slave] * 3
        slaves = [slave]
        for displaced in table:
            m, e, m2, e2 = masters[-1], relative[-1], masters[-3], relative[-3]
            drive = self.A * e + (1 - self.A) * m + self.B * (m - m2)
            masters.append(drive - np.clip(drive - m, -play, play))
            drive = self.A * m + (1 - self.A) * e + self.B * (e - e2)
            relative.append(drive - np.clip(drive + displaced - slaves[-1], -play, play))
            slaves.append(relative[-1] + displaced)
        return np.array(masters[2:]), np.array(slaves)
