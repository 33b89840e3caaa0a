"""A numeric screen of sets of coordinates: the small ones for which no configuration was found where they fail."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from wbc import validation
from wbc.analysis.algebra.trig_form import TrigForm, trig_form
from wbc.analysis.certificates.weakest import RankWitness, joint_values, least, numeric_witness, peak, weakest
from wbc.analysis.jacobians.jacobian import symbolic_jacobian
from wbc.analysis.jacobians.model import ExactModel, checked_model
from wbc.analysis.rows import Rows, checked
from wbc.validation import Array

#: Below this ratio of singular values at a witness of another set a set fails as well
_FAILS = 1e-7


@dataclass(frozen=True, eq=False)
class Screened:
    """A set of constraints for a task.

    Attributes:
        names: of the candidates in it. rows: their declarations. ratio: the least sigma_min(J_R) / sigma_min(J_T) that
            the search found outside the tube: an estimate from above, no bound. q: where, one number a joint.
    """

    names: tuple[str, ...]
    rows: tuple[Rows, ...]
    ratio: float
    q: Array


def screen(
    model: ExactModel,
    task: Sequence[Rows],
    candidates: Mapping[str, Rows],
    *,
    most: int = 3,
    part: float = 0.01,
    minutes: float = 30.0,
    progress: Callable[[float], None] | None = None,
) -> tuple[Screened, ...]:
    """Sets of the fewest candidates that may be complete, the best conditioned first; none with ``most`` or fewer: ().

    Of each set the weakest configurations are searched for, and a witness near them. A witness excludes every other
    set that fails there. What is left is not proved: :func:`wbc.analysis.certify` does that.

    Args:
        candidates: name -> constraint rows. most: candidates in a set. part: as of ``certify``. minutes: by the clock;
            after them the sets of the present size that were looked at are the answer.

    Raises:
        ShapeError: no candidates. RangeError: ``most`` below 1. UnsupportedJointError: entries in a sliding joint.
    """
    wanted = checked("task", task)
    candidates = validation.mapping("candidates", candidates, "names to rows")
    checked("candidates", tuple(candidates.values()))
    most = validation.integer("most", most, low=1)
    part = validation.scalar("part", part, low=0.0, high=1.0, open_low=True)
    validation.function("progress", progress)
    checked_model(model)
    until = time.monotonic() + 60.0 * validation.scalar("minutes", minutes)
    rng = np.random.default_rng(0)
    own = trig_form(model.ring, symbolic_jacobian(model, wanted).matrix)
    forms = {name: trig_form(model.ring, symbolic_jacobian(model, [r]).matrix) for name, r in candidates.items()}
    eps = part * peak(own, rng, until)
    known: list[Array] = []
    total = sum(1 for size in range(1, most + 1) for _ in combinations(candidates, size))
    done = 0
    for size in range(1, most + 1):
        found: list[Screened] = []
        for names in combinations(candidates, size):
            if time.monotonic() > until:
                break
            done += 1
            if progress is not None:
                progress(done / total)
            parts = [forms[name] for name in names]
            rows = tuple(candidates[name] for name in names)
            if own.shape[0] + sum(f.shape[0] for f in parts) < model.robot.nv or _fails(own, parts, known):
                continue
            q, ratio = weakest(own, parts, eps, rng, until)
            witness = _witness(model, wanted, rows, q, eps)
            if witness is not None:
                known.append(joint_values(model, witness.q))
            else:
                found.append(Screened(names, rows, float(ratio[0]), q[0]))
        left = [s for s in found if not _fails(own, [forms[name] for name in s.names], known)]
        if left:
            return tuple(sorted(left, key=lambda s: -s.ratio))
    return ()


def _witness(
    model: ExactModel, task: tuple[Rows, ...], rows: tuple[Rows, ...], starts: Array, eps: float
) -> RankWitness | None:
    every = trig_form(model.ring, symbolic_jacobian(model, (*task, *rows)).matrix)
    return numeric_witness(model, task, rows, every, starts, eps)


def _fails(task: TrigForm, parts: Sequence[TrigForm], known: Sequence[Array]) -> bool:
    """Whether a set is deficient at one of the configurations."""
    if not known:
        return False
    q = np.array(known)
    rows = task.value(q)
    together = np.concatenate([rows, *(form.value(q) for form in parts)], axis=1)
    return bool((least(together) < _FAILS * least(rows)).any())
