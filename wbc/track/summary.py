"""The figures of a run, worked out from its log alone."""

from __future__ import annotations

import json
import math
import pathlib
from dataclasses import dataclass
from typing import Any

import numpy as np

from wbc.controller import Status
from wbc.log import Log
from wbc.tick.outcome import STATUSES
from wbc.validation import Array


@dataclass(frozen=True)
class Figure:
    """One line of the summary: ``key`` for programs, ``label`` and ``text`` for people, ``value`` in SI units."""

    key: str
    label: str
    value: Any
    text: str


def summarise(log: Log) -> list[Figure]:
    """The figures, in the order in which they are shown."""
    meta = log.meta
    done = f"{meta['ticks']} of {meta['planned']} ticks of {1e3 * meta['dt']:g} ms"
    state = "interrupted" if meta["interrupted"] else "complete"
    out = [Figure("run", "run", state, f"{state}, {done}")]
    if len(log) == 0:
        return out
    out += _tracking(log)
    if hindrance := meta.get("hindrance"):
        text = f"{hindrance['text']} ({hindrance['t']:.3g} s)"
        out.append(Figure("hindrance", "what stood in the way", hindrance, text))
    out += _clearances(log)
    out += _limits(log)
    out += _solver(log)
    return out


def save_summary(figures: list[Figure], folder: pathlib.Path) -> pathlib.Path:
    """Write ``summary.json``: key -> value in SI units; returns the file."""
    file = folder / "summary.json"
    file.write_text(json.dumps({f.key: f.value for f in figures}, indent=1) + "\n")
    return file


def rotation_angles(log: Log) -> Array:
    """Angle between commanded and reached orientation of the frame [rad]."""
    a, b = (log.array(name)[:, 3:] for name in ("pose", "target"))
    # |a - b| and |a + b| are 2 sin and 2 cos of a quarter of the angle
    return np.asarray(4.0 * np.arctan2(_chord(a, b, -1.0), _chord(a, b, 1.0)))


def position_errors(log: Log) -> Array:
    """Distance between commanded and reached position of the frame [m]."""
    return np.asarray(np.linalg.norm(log.array("pose")[:, :3] - log.array("target")[:, :3], axis=1))


def _chord(a: Array, b: Array, sign: float) -> Array:
    """|a + sign b| with the sign of b chosen so that both are on one hemisphere; exact for small angles."""
    turned = np.where((np.sum(a * b, axis=1) < 0.0)[:, None], -b, b)
    return np.asarray(np.linalg.norm(a + sign * turned, axis=1))


def acceleration_shares(log: Log) -> Array:
    """|a| / limit by tick and degree of freedom; 0 where there is no limit."""
    limit = np.array([math.inf if x is None else x for x in log.meta["limits"]["acceleration"]])
    return np.asarray(np.abs(log.array("a")) / np.where(limit > 0.0, limit, math.inf))


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(np.square(values))))


def _tracking(log: Log) -> list[Figure]:
    position, angle = position_errors(log), rotation_angles(log)
    out = []
    for key, label, values, factor, unit in (
        ("position_error", "position error", position, 1e3, "mm"),
        ("rotation_error", "rotation error", np.degrees(angle), 1.0, "deg"),
    ):
        if key == "rotation_error" and log.meta.get("kind") == "position":
            continue
        text = f"max {factor * values.max():.3g} {unit}, rms {factor * _rms(values):.3g} {unit}"
        stored = values if unit == "mm" else np.radians(values)
        out.append(Figure(key, label, {"max": float(stored.max()), "rms": _rms(stored)}, text))
    if "plane.command" in log:
        off = log["error.plane.plane"]
        worst, rms = float(np.abs(off).max()), _rms(off)
        text = f"max {worst:.3g} rad, rms {rms:.3g} rad"
        out.append(Figure("plane_error", "elbow plane error", {"max": worst, "rms": rms}, text))
    return out


def _clearances(log: Log) -> list[Figure]:
    columns = log.group("clearance")
    if not columns:
        return []
    link = min(columns, key=lambda name: columns[name].min())
    least = float(columns[link].min())
    out = [Figure("clearance", "least clearance, link shapes", {"least": least, "link": link}, _gap(least, link))]
    nearest = log.meta.get("mesh_clearance")
    if nearest is not None:
        text = _gap(nearest["least"], nearest["link"])
        out.append(Figure("mesh_clearance", "least clearance, meshes", dict(nearest), text))
    out.append(Figure("margin", "margin asked for", log.meta["margin"], f"{1e3 * log.meta['margin']:g} mm"))
    return out


def _gap(least: float, link: str) -> str:
    return f"{1e3 * least:.2f} mm at {link} (coal)"


def _limits(log: Log) -> list[Figure]:
    out = []
    shares = acceleration_shares(log)
    if shares.size and shares.max() > 0.0:
        tick, dof = np.unravel_index(int(np.argmax(shares)), shares.shape)
        name, unit = log.meta["dofs"][dof], log.meta["dof_units"][dof]
        value = float(np.abs(log.array("a"))[tick, dof])
        limit = log.meta["limits"]["acceleration"][dof]
        text = f"{value:.3g} of {limit:g} {unit}/s^2 at {name}"
        out.append(Figure("acceleration", "largest acceleration", {"share": float(shares.max()), "dof": name}, text))
    speed_limit = np.array([math.inf if x is None else x for x in log.meta["limits"]["velocity"]])
    speeds = np.abs(log.array("v")) / np.where(speed_limit > 0.0, speed_limit, math.inf)
    if speeds.size and speeds.max() > 0.0:
        tick, dof = np.unravel_index(int(np.argmax(speeds)), speeds.shape)
        name, unit = log.meta["dofs"][dof], log.meta["dof_units"][dof]
        text = f"{np.abs(log.array('v'))[tick, dof]:.3g} of {speed_limit[dof]:g} {unit}/s at {name}"
        out.append(Figure("velocity", "largest velocity", {"share": float(speeds.max()), "dof": name}, text))
    return out


def _solver(log: Log) -> list[Figure]:
    binding = {name: float(np.mean(flags)) for name, flags in log.group("binding").items()}
    ranked = sorted(binding.items(), key=lambda item: -item[1])
    shown = [f"{name} {100 * share:.1f} %" for name, share in ranked[:6]]
    more = [f"and {len(ranked) - 6} more"] if len(ranked) > 6 else []
    status = log["status"]
    counts = {str(s): int((status == k).sum()) for k, s in enumerate(Status) if s in STATUSES}
    tick = log["tick"]
    times = {"median": float(np.median(tick)), "p99": float(np.quantile(tick, 0.99)), "max": float(tick.max())}
    meta = log.meta
    from_cache = "from the cache" if meta["cached"] else "compiled now"
    return [
        Figure("binding", "binding rows, share of ticks", binding, "\n".join([*shown, *more]) or "none"),
        Figure("status", "ticks", counts, ", ".join(f"{n} {name}" for name, n in counts.items())),
        Figure("error_bound", "largest certified error of v", float(log["error_bound"].max()), _bound(log)),
        Figure(
            "tick",
            "tick time, controller.step",
            times,
            f"median {1e6 * times['median']:.1f} us, p99 {1e6 * times['p99']:.1f} us, max {1e6 * times['max']:.0f} us",
        ),
        Figure("solver", "solver", meta["solver"], f"{meta['solver']}, {meta['backend']} tick"),
        Figure("compile_time", "ready after", meta["compile_time"], f"{meta['compile_time']:.2f} s, {from_cache}"),
    ]


def _bound(log: Log) -> str:
    worst = float(log["error_bound"].max())
    return f"{worst:.1e} rad/s" if math.isfinite(worst) else "none for braked ticks"
