"""Runs as datasets of LeRobot, version 3.0, one episode each, without images."""

from __future__ import annotations

import pathlib

import numpy as np

from wbc import extras
from wbc.formats.errors import FormatError
from wbc.formats.run import Run, SeenTick
from wbc.log import Log
from wbc.log.lerobot import write_lerobot_dataset

#: Largest difference of a tick's time from the grid of frames [s]
TOLERANCE = 1e-4


class LeRobotSink:
    """A folder: ``observation.state`` is the configuration, ``action`` the command of each tick.

    Raises:
        MissingPackageError: pyarrow is not installed.
    """

    def __init__(self, path: pathlib.Path) -> None:
        extras.require("recordings", "a dataset of LeRobot")
        self._path, self._logs = path, list[Log]()
        path.mkdir()

    def begin(self, run: Run) -> None:
        """Whose motion it is."""
        self._robot = str(run.about.get("robot", ""))

    def write(self, log: Log, seen: list[SeenTick]) -> None:
        """Keep them: statistics come before the file is whole."""
        self._logs.append(log)

    def close(self) -> None:
        """Write the folder.

        Raises:
            FormatError: no ticks, none at whole frames a second, or no command.
        """
        t = np.concatenate([log["t"] for log in self._logs] or [np.zeros(0)])
        if len(t) < 2:
            raise FormatError("run", len(t), "a dataset needs two ticks or more")
        period = float(t[-1] - t[0]) / (len(t) - 1)
        rate = round(1.0 / period) if period > 0.0 else 0
        grid = t[0] + np.arange(len(t)) / max(rate, 1)
        if rate < 1 or np.abs(t - grid).max() > TOLERANCE:
            raise FormatError("run", period, "ticks are not at a whole number a second, which frames of LeRobot are")
        groups = {"observation.state": "q", "action": "v" if self._logs[0].group("v") else "a"}
        parts = {name: np.concatenate([log.array(group) for log in self._logs]) for name, group in groups.items()}
        for name, numbers in parts.items():
            if not numbers.shape[1]:
                raise FormatError("run", groups[name], f"has no columns for {name}")
        members = {name: list(self._logs[0].group(group)) for name, group in groups.items()}
        write_lerobot_dataset(self._path, self._robot, rate, members, [parts], [f"run of {self._robot}"])
