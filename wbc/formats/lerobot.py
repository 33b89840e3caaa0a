"""Runs as datasets of LeRobot, version 3.0, one episode each, without images."""

from __future__ import annotations

import pathlib

import numpy as np

from wbc import extras
from wbc.formats.errors import FormatError
from wbc.formats.tables import WholeSink
from wbc.log.lerobot import write_lerobot_dataset

#: Largest difference of a tick's time from the grid of frames [s]
TOLERANCE = 1e-4


class LeRobotSink(WholeSink):
    """A folder: ``observation.state`` is the configuration, ``action`` the command of each tick.

    Raises:
        MissingPackageError: pyarrow is not installed.
    """

    def __init__(self, path: pathlib.Path) -> None:
        extras.require("recordings", "a dataset of LeRobot")
        super().__init__(path)
        path.mkdir()

    def close(self) -> None:
        """Write the folder.

        Raises:
            FormatError: no ticks, none at whole frames a second, or no command.
        """
        log, robot = self.whole(), str(self._about.get("robot", ""))
        t = log["t"]
        if len(t) < 2:
            raise FormatError("run", len(t), "a dataset needs two ticks or more")
        period = float(t[-1] - t[0]) / (len(t) - 1)
        rate = round(1.0 / period) if period > 0.0 else 0
        if rate < 1 or np.abs(t - t[0] - np.arange(len(t)) / rate).max() > TOLERANCE:
            raise FormatError("run", period, "ticks are not at a whole number a second, which frames of LeRobot are")
        groups = {"observation.state": "q", "action": "v" if log.group("v") else "a"}
        for name, group in groups.items():
            if not log.group(group):
                raise FormatError("run", group, f"has no columns for {name}")
        members = {name: list(log.group(group)) for name, group in groups.items()}
        episode = {name: log.array(group) for name, group in groups.items()}
        write_lerobot_dataset(self._path, robot, rate, members, [episode], [f"run of {robot}"])
