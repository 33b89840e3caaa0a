"""The goals beside the measured figures."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class Goal:
    """One goal: ``value`` is at most ``limit``."""

    text: str
    value: float
    limit: float
    unit: str

    @property
    def met(self) -> bool:
        """Whether it is."""
        return self.value <= self.limit


def goals(results: dict[str, Any]) -> list[Goal]:
    """All goals that the results can speak of."""
    out: list[Goal] = []
    problems, startup = results["problems"], results["startup"]
    for name, peer, limit in (
        ("panda", "pink + daqp", 1 / 20),
        ("panda", "placo", 1.0),
        ("talos", "pink + daqp", 1 / 8),
        ("talos", "placo", 1.0),
    ):
        contenders = problems.get(name, {}).get("contenders", {})
        if peer in contenders and "wbc" in contenders:
            ratio = _median(contenders["wbc"]) / _median(contenders[peer])
            out.append(Goal(f"{name} tick as a fraction of {peer}'s", ratio, limit, ""))
    if "panda" in problems:
        own = problems["panda"]["contenders"]
        added = _median(own["wbc+expression"]) - _median(own["wbc"])
        out.append(Goal("an Expression task of three lines adds", added, 1.0, "us"))
    for name, limit in (("panda", 3.0), ("talos", 30.0)):
        if name in startup["compile"]:
            out.append(Goal(f"{name} first compile", startup["compile"][name]["first"], limit, "s"))
            out.append(Goal(f"{name} cached compile", startup["compile"][name]["cached"], 0.5, "s"))
    out += curve_goals(results.get("curves", ()))
    out.append(Goal("import wbc", startup["import"]["wbc"], 1.0, "s"))
    if "wbc" in startup["memory"]:
        out.append(Goal("memory of a Panda controller process", startup["memory"]["wbc"] / 1e6, 250.0, "MB"))
    return out


def curve_goals(curves: Sequence[dict[str, Any]]) -> list[Goal]:
    """Those of the growing problems."""
    out = []
    for point in curves:
        found = point["contenders"]
        own = found["wbc"]["median"]
        if point["curve"] == "g1":
            for peer in [name for name in found if name.startswith("mink")]:
                ratio = own / found[peer]["median"]
                out.append(Goal(f"G1 tick, self-collision of 20 pairs, as a fraction of {peer}'s", ratio, 0.2, ""))
        if (point["curve"], point["x"]) == ("spheres", 50.0):
            out.append(Goal("panda tick with 50 spheres", own, 40.0, "us"))
    return out


def _median(contender: dict[str, Any]) -> float:
    return float(contender["durations"]["call"]["median"])
