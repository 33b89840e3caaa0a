"""What the hands of a walk bore over its time."""

from __future__ import annotations

import os
import pathlib
from dataclasses import dataclass

import numpy as np

from wbc.robots import HoldRating
from wbc.validation import Array
from wbc.walking.log.folder import write_whole

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
        """Write all numbers as ``loads.npz``; returns the file.

        Raises:
            WalkLogError: it cannot be written.
        """
        arrays = {name: getattr(self, name) for name in ("time", "force", "moment", "off", "given")}
        rating = np.array([self.rating.force, self.rating.torque])
        noted = np.array([text for _, text in self.noted], dtype=str)
        times = np.array([time for time, _ in self.noted])

        def write(file: pathlib.Path) -> None:
            with file.open("wb") as stream:
                np.savez_compressed(stream, allow_pickle=False, **arrays, rating=rating, noted=noted, noted_at=times)

        return write_whole(pathlib.Path(folder) / LOADS, write)
