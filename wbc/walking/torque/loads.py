"""What the hands of a walk bore over its time."""

from __future__ import annotations

import os
import pathlib
from dataclasses import dataclass

from wbc.log import Log, save
from wbc.robots import HoldRating
from wbc.validation import Array

#: Name of the file in a run's folder
LOADS = "loads.npz"


@dataclass(frozen=True, eq=False)
class Loads:
    """The worst of every period of a walk, of n periods and a hands; NaN where a hand holds nothing.

    Attributes:
        time: at the end of each ``[n]`` [s]. force, moment: largest component of each grip's wrench ``[n, a]`` [N],
            [N m]. off: of each held frame from where its grip closed ``[n, a]`` [m].
        given: momentum given to the structure, largest component, linear and angular about the body ``[n, 2]`` [N s],
            [N m s].
        rating: of every hold. noted: what the loop found wrong, (time [s], in words).
    """

    time: Array
    force: Array
    moment: Array
    off: Array
    given: Array
    rating: HoldRating
    noted: tuple[tuple[float, str], ...]

    def save(self, folder: str | os.PathLike[str]) -> pathlib.Path:
        """Write ``loads.npz``, a :class:`wbc.log.Log` of these periods, hands by their numbers; returns the file.

        Raises:
            LogFileError: it cannot be written.
        """
        units = {"force": "N", "moment": "N m", "off": "m"}
        columns, found = {"t": self.time}, {"t": "s"}
        for name, unit in units.items():
            for hand, values in enumerate(getattr(self, name).T, start=1):
                columns[f"{name}.{hand}"], found[f"{name}.{hand}"] = values, unit
        for values, kind, unit in zip(self.given.T, ("linear", "angular"), ("N s", "N m s"), strict=True):
            columns[f"given.{kind}"], found[f"given.{kind}"] = values, unit
        rating = {"force": self.rating.force, "torque": self.rating.torque}
        log = Log(columns, found, {"rating": rating, "noted": [list(one) for one in self.noted]})
        return save(log, pathlib.Path(folder), "npz", pathlib.Path(LOADS).stem)
