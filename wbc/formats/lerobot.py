"""Runs as datasets of LeRobot, version 3.0, one episode each, without images."""

from __future__ import annotations

import numpy as np

from wbc.formats.errors import FormatError
from wbc.formats.tables import WholeSink
from wbc.log.lerobot import write_lerobot_dataset

#: Largest difference of a tick's time from the grid of frames [s]
TOLERANCE = 1e-4


class LeRobotSink(WholeSink):
    """A folder: ``observation.state`` is the configuration, ``action`` the command of each tick."""

    needs = ("recordings", "a dataset of LeRobot")

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
        names = {feature: list(log.group(group)) for feature, group in groups.items()}
        if lacking := [feature for feature, members in names.items() if not members]:
            raise FormatError("run", groups[lacking[0]], f"has no columns for {lacking[0]}")
        episode = {feature: log.array(group) for feature, group in groups.items()}
        self._path.mkdir()
        write_lerobot_dataset(self._path, robot, rate, names, [episode], [f"run of {robot}"])
