"""The files of a run: ``summary.json``, ``trials.csv`` and the first trials tick by tick in ``first.npz``."""

from __future__ import annotations

import csv
import dataclasses
import json
import math
import pathlib
from collections.abc import Mapping
from typing import Any

import numpy as np

from wbc.moving_target.knowledge import Knowledge
from wbc.moving_target.study import Outcome, TargetStudy
from wbc.moving_target.trial import TargetTrial

SUMMARY = "summary.json"
"""What was asked and what came of it."""
WRITTEN = (SUMMARY, "trials.csv", "first.npz", "error.png", "object.png", "trials.png", "film.gif", "film.mp4")
"""All files of a run, those of the plots and the film too."""


def save(
    study: TargetStudy,
    done: Mapping[Knowledge, list[TargetTrial]],
    figures: Mapping[Knowledge, Outcome],
    folder: pathlib.Path,
) -> list[pathlib.Path]:
    """Write them; returns the files."""
    s = study.scenario
    summary: dict[str, Any] = {
        "robot": s.robot.name,
        "tip": s.tip,
        "motion": study.motion,
        "severity": study.severity,
        "rate": s.rate,
        "clearance": s.clearance,
        "measurement": dataclasses.asdict(s.measurement),
        "policy": dataclasses.asdict(s.policy),
        "outcomes": {str(kind): dataclasses.asdict(found) for kind, found in figures.items()},
    }
    files = [folder / name for name in (SUMMARY, "trials.csv", "first.npz")]
    files[0].write_text(json.dumps(_plain(summary), indent=1) + "\n")
    with files[1].open("w", newline="") as stream:
        writer = csv.writer(stream)
        writer.writerow(("knowledge", "trial", "success", "reason", "time", "began", "rms", "worst", "rate"))
        for kind, trials in done.items():
            for number, trial in enumerate(trials):
                size = np.linalg.norm(trial.error[trial.working, :3], axis=1)
                numbers = (trial.time, trial.began, np.sqrt(np.mean(size**2)), size.max(), trial.rates.max())
                writer.writerow(
                    (
                        kind,
                        number,
                        trial.success,
                        trial.reason,
                        *map("{:.6g}".format, numbers),
                    )
                )
    arrays = {
        f"{kind}_{name}": getattr(trials[0], name)
        for kind, trials in done.items()
        for name in ("t", "q", "command", "error", "known", "rates", "goal")
    }
    np.savez_compressed(files[2], **arrays)
    return files


def _plain(value: Any) -> Any:
    """Numbers that are none become null."""
    if isinstance(value, dict):
        return {key: _plain(v) for key, v in value.items()}
    if isinstance(value, (list, tuple)):
        return [_plain(v) for v in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value
