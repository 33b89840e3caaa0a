"""Laws that are met on a grid, made to keep their limits everywhere."""

from __future__ import annotations

import numpy as np

from wbc.errors import InfeasibleError
from wbc.trajectory.laws.between import highest
from wbc.trajectory.laws.certificate import SAMPLES, TOLERANCE, Check, LawCertificate, LawPieces
from wbc.trajectory.laws.law import Law
from wbc.trajectory.least_time.checks import at_rest
from wbc.trajectory.least_time.fastest import FastestTask, Shrunk
from wbc.trajectory.paths.path import Index
from wbc.validation import Array

#: A slower law than this is not looked for, where a finer grid may do
LOSS = 0.005

#: Grids, each twice as fine as the one before
GRIDS = 4

#: Rounds of shrinking limits on one grid
ROUNDS = 6

#: Margin beyond the tolerance of a certificate
MARGIN = 1e-9

#: Largest factor of time by which forces are repaired
SLOWEST = 4.0


def repaired(task: FastestTask, count: int | None = None) -> Law:
    """The fastest law of a task that its certificate finds within limits.

    From rest to rest time is stretched evenly, by max(v, sqrt a) for velocities and accelerations and by bisection for
    forces, since gravity does not shrink; between other speeds limits are shrunk on the grid.

    Raises:
        InfeasibleError: standing still or the end speeds exceed limits. RangeError: nothing limits the motion.
    """
    return _stretched(task, count) if task.rests else _shrunk(task, count)


def _law(task: FastestTask, refined: int, count: int | None, shrunk: Shrunk | None = None) -> Law:
    total = None if count is None else count * refined
    return Law(task.path, task.timing(refined, total, shrunk), task.limits, task.checks)


def _stretched(task: FastestTask, count: int | None) -> Law:
    law, factor = _law(task, 1, count), np.inf
    # What a finer grid gains with checks is less than what it costs to sample them
    for k in range(2 if task.checks else GRIDS):
        law = _law(task, 2**k, count) if k else law
        factor = _factor(task, law)
        if factor <= 1.0 + LOSS:
            break
    if not np.isfinite(factor):
        worst = max((law.certificate.worst[f.name] for f in task.forces), key=lambda w: w.ratio)
        raise InfeasibleError(
            "path", worst.ratio, f"forces at {worst.time:.6g} s exceed their limits however slow the motion is"
        )
    law = law.scaled(factor)
    # Samples of a slower law lie elsewhere, and may find a little more
    for _ in range(ROUNDS if task.path.degree is None else 0):
        if law.certificate.satisfied:
            break
        law = law.scaled(_factor(task, law) * (1.0 + MARGIN))
    return law


def _factor(task: FastestTask, law: Law) -> float:
    """Factor of time at which all limits are satisfied, inf if there is none below :data:`SLOWEST`."""
    worst = Law(law.path, law.timing, task.limits, task.speeds).certificate.worst
    linear = ["velocity", *(check.name for check in task.speeds)]
    needed = [worst[name].ratio for name in linear if name in worst]
    if "acceleration" in worst:
        needed.append(float(np.sqrt(worst["acceleration"].ratio)))
    factor = max(needed, default=0.0)
    if not task.forces:
        return factor
    factor = max(factor, 1.0)
    pieces = LawPieces.of(law.path, law.timing)
    for force in task.forces:
        factor = _slower(law, pieces, force, factor)
    return factor


class _Forces:
    """Forces of a law by the factor k of its time, c + (f - c) / k^2 with c those at rest; sampled once a point."""

    def __init__(self, law: Law, pieces: LawPieces, force: Check) -> None:
        self.law, self.pieces, self.force = law, pieces, force
        self._known: dict[tuple[int, int], tuple[Array, Array]] = {}

    def satisfied(self, factor: float) -> bool:
        """Whether the bound of all ratios is at most 1."""
        return highest(self.pieces.span, lambda some, count: self._at(some, count, factor), SAMPLES).bound <= 1.0

    def _at(self, some: Index, count: int, factor: float) -> Array:
        missing = np.array([n for n in some if (int(n), count) not in self._known], dtype=np.intp)
        if missing.size:
            state = self.pieces.some(missing).states(self.law.path, self.law.timing, count)
            shape = (len(missing), count + 1, -1)
            rest = at_rest(self.force, state[0]).reshape(shape)
            moving = self.force.ratios(*state).reshape(shape)
            self._known |= {(int(n), count): (c, f - c) for n, c, f in zip(missing, rest, moving, strict=True)}
        known = [self._known[int(n), count] for n in some]
        return np.stack([c + f / factor**2 for c, f in known])


def _slower(law: Law, pieces: LawPieces, force: Check, factor: float) -> float:
    """The smallest factor of time from ``factor`` on at which sampled forces keep their limits, by bisection."""
    forces = _Forces(law, pieces, force)
    low, high, step = factor, factor, 1e-3
    while not forces.satisfied(high):
        low, high, step = high, factor * (1.0 + step), 2.0 * step
        if high > SLOWEST * factor:
            return np.inf
    for _ in range(20 if high > low else 0):
        middle = 0.5 * (low + high)
        low, high = (low, middle) if forces.satisfied(middle) else (middle, high)
    return high


def _shrunk(task: FastestTask, count: int | None) -> Law:
    """Between given path speeds: limits on the grid are shrunk by what the certificate finds beyond them."""
    failed: InfeasibleError | None = None
    for k in range(GRIDS):
        shrunk = Shrunk()
        for _ in range(ROUNDS):
            try:
                law = _law(task, 2**k, count, shrunk)
            except InfeasibleError as error:
                failed = error
                if shrunk == Shrunk():
                    raise
                break
            if law.certificate.satisfied:
                return law
            shrunk = _more(task, shrunk, law.certificate)
    raise failed or InfeasibleError("start_speed", (task.start, task.end), "no law between these path speeds was found")


def _more(task: FastestTask, shrunk: Shrunk, certificate: LawCertificate) -> Shrunk:
    def over(*names: str) -> float:
        ratios = [certificate.worst[name].ratio for name in names if name in certificate.worst]
        worst = max(ratios, default=0.0)
        return worst + MARGIN if worst > 1.0 + TOLERANCE else 1.0

    return Shrunk(
        shrunk.velocity * over("velocity"),
        shrunk.acceleration * over("acceleration"),
        shrunk.speed * over(*(check.name for check in task.speeds)),
        shrunk.force * over(*(check.name for check in task.forces)),
    )
