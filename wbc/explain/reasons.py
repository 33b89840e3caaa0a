"""Which :class:`Reason` each task of a past tick has: from its own rows, and from what the rest of the stack does."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from wbc.explain.alone import MET, SINGULAR, Alone, NearestAnswer
from wbc.explain.explanation import ExplainedBound, Loss
from wbc.explain.past import PastTick
from wbc.explain.reason import Reason
from wbc.stack.layout import Block
from wbc.tasks.mechanism import Mechanism
from wbc.validation import Array

#: A task that moves at this share of its rates, or more, does what it is asked
_SERVED = 0.9
#: A task that moves at less than this share of its rates is at rest
_RESTS = 0.02
#: Of a task that asks for so many times what its error alone would, the target moves
_MOVES = 3.0
#: Slower than this a task asks for nothing [1/s times radians or characteristic lengths]
_ASKS = 1e-6


def reasons(
    past: PastTick, v: Array, binding: tuple[ExplainedBound, ...], losses: tuple[Loss, ...]
) -> tuple[Reason, ...]:
    """One for every task with a gain that is on and is no scaled one."""
    out = []
    for block in past.layout.of_form("task"):
        if past.is_on(block) and block.share < 0 and "gain" in block.slots:
            found = _ReasonFinder(past, block, v).reason(
                binding, [loss for loss in losses if loss.task == block.entry.name]
            )
            if found is not None:
                out.append(found)
    return tuple(out)


class _ReasonFinder:
    """Finds the reason of one task."""

    def __init__(self, past: PastTick, block: Block, v: Array) -> None:
        self.past, self.block, self.alone = past, block, Alone(past, block)
        self.q = past.tick.q.copy()
        self.here = self.alone.at(self.q)
        self.gain = float(past.tick.p[block.slots["gain"].span][0])
        J, desired = past.task_rows(block)
        scales = past.layout.row_scales(past.stack)[block.span]
        chosen = self.alone.counts
        served = ((J @ v) / scales)[chosen]
        #: rates that are asked for, and that the command gives
        self.asked, self.served = (desired / scales)[chosen], served
        idle = ~np.abs(J[chosen]).max(axis=1, initial=0.0).astype(bool)
        self.asked[idle] = -self.gain * self.here.e[idle]
        self.rates = self.here.J @ (v[: past.layout.nv] / past.layout.dof_scales(past.stack)[: past.layout.nv])

    def reason(self, binding: tuple[ExplainedBound, ...], losses: list[Loss]) -> Reason | None:
        """The reason; None where the error is zero and the task moves."""
        off, asks = float(np.abs(self.here.e).max(initial=0.0)), float(np.linalg.norm(self.asked))
        if off < MET and asks < _ASKS:
            return self._say("done") if float(np.linalg.norm(self.served)) < _ASKS else None
        share = float(self.asked @ self.served) / asks**2 if asks > _ASKS else 1.0
        if off < MET:
            return None if share >= _SERVED else self._moving(share, binding, losses)
        found = self.alone.nearest()
        if not found.met:
            return self._out_of_reach(found)
        if share >= _SERVED or asks <= _ASKS:
            return self._say("slow")
        return self._moving(share, binding, losses)

    def _moving(self, share: float, binding: tuple[ExplainedBound, ...], losses: list[Loss]) -> Reason:
        """A task that can be met and is not served."""
        names = self._holders(binding, losses)
        only = [bound for bound in binding if str(bound) in names]
        limits = len(only) == len(names) and all(bound.kind in ("velocity", "acceleration") for bound in only)
        if names and np.linalg.norm(self.asked) > _MOVES * self.gain * np.linalg.norm(self.here.e):
            return replace(self._say("limited" if limits else "held", by=names), follows=share)
        lost, least = self.here.lost(self.alone.free(self.q, self.here), SINGULAR)
        if np.linalg.norm(lost) > LOST * np.linalg.norm(self.here.e) and share < _SERVED:
            return self._singular(lost, least)
        with self.past.without(self.past.others(self.block)):
            v = self.past.solve()[0]
        scales = self.past.layout.dof_scales(self.past.stack)[: self.past.layout.nv]
        free = float(self._towards(self.here.J @ (v[: len(scales)] / scales)))
        now = float(self._towards(self.rates))
        if (now >= _SERVED * free and free > 0.0) or not names:
            return self._say("slow" if now > 0.0 else "minimum")
        if limits:
            return self._say("limited", by=names)
        return self._say("minimum" if now <= _RESTS * max(free, 1e-12) else "held", by=names)

    def _towards(self, rates: Array) -> float:
        """How fast the error falls."""
        return float(-self.here.e @ rates / max(float(np.linalg.norm(self.here.e)), 1e-12))

    def _holders(self, binding: tuple[ExplainedBound, ...], losses: list[Loss]) -> tuple[str, ...]:
        """What the task would regain something without: of constraints the bounds that push, else all that push."""
        to = sorted(((s.amount, s.item) for loss in losses for s in loss.to), reverse=True)
        names: list[str] = []
        for item in dict.fromkeys(item for _, item in to) or dict.fromkeys(bound.item for bound in binding):
            bounds = [str(bound) for bound in binding if bound.item == item]
            names += bounds or [item]
        return tuple(names)

    def _singular(self, lost: Array, least: float) -> Reason:
        unit = lost / np.linalg.norm(lost)
        labels = [row.label for row, counts in zip(self.block.rows, self.alone.counts, strict=True) if counts]
        direction = tuple((a, float(x)) for a, x in zip(labels, unit, strict=True) if abs(x) > 0.01)
        restores = ""
        gradient = float(np.linalg.norm(self.here.J.T @ self.here.e))
        curvature, step = self.alone.escape(self.q)
        if curvature < -FLAT:
            restores = self.past.stack.robot.dof_names[int(np.abs(step).argmax())]
        elif gradient < SINGULAR * float(np.linalg.norm(self.here.e)):
            return self._say("minimum")
        out = self._say("singular")
        return replace(out, singular=least, direction=direction, lost=self._norms(lost), restores=restores)

    def _out_of_reach(self, found: NearestAnswer) -> Reason:
        robot, item = self.past.stack.robot, self.block.entry.item
        index, near = robot.position_index, found.q
        at = np.where(index >= 0, near[np.maximum(index, 0)], np.nan)
        touching = (np.abs(at - self.alone.lower) < 1e-6) | (np.abs(at - self.alone.upper) < 1e-6)
        without: tuple[str, ...] = ()
        if self.alone.holds() and self.alone.nearest(own=True).met:
            without = tuple(b.entry.name for b in self.past.layout.of_form("rows") if self._holds(b))
        elif touching.any() and self.alone.nearest(limited=False).met:
            joints = ", ".join(name for name, yes in zip(robot.dof_names, touching, strict=True) if yes)
            without = (f"the position limits of {joints}",)
        frame = getattr(item, "frame", None)
        place = robot.pose(near, frame).translation if isinstance(frame, str) and frame in robot.frame_names else None
        beyond = self._norms(found.e)
        out = self._say("reach")
        return replace(out, beyond=beyond, nearest=near, place=place, starts=found.starts, without=without)

    def _holds(self, block: Block) -> bool:
        """An item that ties the robot to where it is."""
        item = block.entry.item
        return self.past.is_on(block) and getattr(item, "equality", False) and not isinstance(item, Mechanism)

    def _norms(self, e: Array) -> tuple[tuple[float, str], ...]:
        """Norms by unit, of errors in radians and characteristic lengths."""
        scales = self.past.layout.row_scales(self.past.stack)[self.block.span][self.alone.counts]
        units = [row.unit for row, counts in zip(self.block.rows, self.alone.counts, strict=True) if counts]
        return tuple(
            (float(np.linalg.norm([x * s for x, s, u in zip(e, scales, units, strict=True) if u == unit])), unit)
            for unit in dict.fromkeys(units)
        )

    def _falls(self) -> tuple[tuple[float, str], ...]:
        """How fast the norm of the error falls, by unit."""
        scales = self.past.layout.row_scales(self.past.stack)[self.block.span][self.alone.counts]
        units = np.array([row.unit for row, counts in zip(self.block.rows, self.alone.counts, strict=True) if counts])
        e, rates = self.here.e * scales, self.rates * scales
        out = []
        for unit in dict.fromkeys(units.tolist()):
            mine = units == unit
            size = float(np.linalg.norm(e[mine]))
            out.append((float(-e[mine] @ rates[mine]) / size if size > MET else 0.0, unit))
        return tuple(out)

    def _say(self, kind: str, by: tuple[str, ...] = ()) -> Reason:
        return Reason(self.block.entry.name, kind, self._norms(self.here.e), self._falls(), self.gain, by=by)


#: Share of a task's error that lies where no joint serves it, from which on the task is lost
LOST = 0.3
#: Curvature of |e|^2 / 2 that is none
FLAT = 1e-6
#: A direction is served again from this singular value on [rows and joints in radians or characteristic lengths]
SERVED = 0.05


def way_out(past: PastTick, way: Array | None) -> Array | None:
    """The step of unit length [nv] along which the first lost task's |e|^2 / 2 has its most negative curvature,

        J'J + d(e'J)/dq,      e the error where it is lost

    or ``way`` again, as long as the task is lost; None where no task is, or none has such a step.
    """
    for block in past.layout.of_form("task"):
        if not past.is_on(block) or block.share >= 0 or "gain" not in block.slots:
            continue
        if float(past.tick.p[block.slots["gain"].span][0]) == 0.0:
            continue
        alone = Alone(past, block)
        q = past.tick.q.copy()
        here = alone.at(q)
        size = float(np.linalg.norm(here.e))
        lost = here.lost(alone.free(q, here), SINGULAR if way is None else SERVED)[0]
        if size < MET or np.linalg.norm(lost) < LOST * size:
            continue
        if way is not None:
            return way
        curvature, step = alone.escape(q)
        if curvature < -FLAT:
            return step
    return None
