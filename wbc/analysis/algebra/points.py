"""Real configurations on branches: roots of relations in one joint, random points."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from math import atan, cos, pi, sin
from typing import Any

import numpy as np
from flint import fmpz_poly

from wbc.analysis.algebra.branches import LocusBranch
from wbc.analysis.algebra.half_angles import HalfAngles, HalfPoly, Relation, Value
from wbc.analysis.algebra.notation import coefficients
from wbc.validation import Array

#: A root of a polynomial in floats counts as real when its imaginary part is below this
REAL = 1e-9
#: A relation counts as zero when its value is below this
ZERO = 1e-10
#: Configurations among which the signs of a relation are looked at
SAMPLES = 256


def angle(value: Value, half: HalfAngles) -> float:
    """The coordinate of a joint at a value, in (-pi, pi] for one that turns."""
    if value.joint in half.ring.slides:
        return float(value.value or 0)
    return pi if value.value is None else 2.0 * atan(value.value)


def _scale(relation: Relation) -> int:
    """What the numbers of a relation are divided by: they may be too large for floats."""
    return max(abs(int(number)) for number in relation.poly.coeffs())


def _terms(
    half: HalfAngles, form: HalfPoly, degrees: tuple[int, ...], scale: int, q: Any, functions: tuple[Any, Any]
) -> Iterator[Any]:
    """Terms of a form in sin(q/2), cos(q/2) of given degrees, over a scale, at numbers or at arrays of one shape."""
    sine, cosine = functions
    symbols = [float(v) for v in half.ring.symbols.values()]
    for powers, number in form.terms():
        term = int(number) / scale
        for k, e in enumerate(powers):
            n = int(e)
            if k >= half.size:
                term *= symbols[k - half.size] ** n
            elif k in half.ring.slides:
                term = term * q[k] ** n
            elif degrees[k]:
                term = term * sine(q[k] / 2) ** n * cosine(q[k] / 2) ** (degrees[k] - n)
        yield term


def _sum(half: HalfAngles, form: HalfPoly, degrees: tuple[int, ...], scale: int, q: Array) -> tuple[float, float]:
    """(value, largest term) of a form in sin(q/2), cos(q/2) of given degrees."""
    total = largest = 0.0
    for term in _terms(half, form, degrees, scale, q, (sin, cos)):
        total += term
        largest = max(largest, abs(term))
    return total, largest


def form_grid(half: HalfAngles, relation: Relation, q: Sequence[Array]) -> Array:
    """A relation at many configurations, one array a joint, all of one shape; 0 on the branch."""
    return np.asarray(sum(_terms(half, relation.poly, relation.degrees, _scale(relation), q, (np.sin, np.cos))))


def changes_sign(half: HalfAngles, relation: Relation) -> bool:
    """Whether a relation has both signs among some configurations, so that it has zeros; False proves nothing."""
    rng = np.random.default_rng(0)
    value = form_grid(half, relation, [rng.uniform(-pi, pi, SAMPLES) for _ in range(half.size)])
    tolerance = ZERO * float(np.abs(value).max())
    return bool(value.min() < -tolerance and value.max() > tolerance)


def form_value(half: HalfAngles, relation: Relation, q: Array) -> float:
    """A relation at a configuration, as a form in sin(q/2), cos(q/2), relative to its largest term; 0 on the branch."""
    total, largest = _sum(half, relation.poly, relation.degrees, _scale(relation), q)
    return total / largest if largest > 0.0 else 0.0


def joint_roots(half: HalfAngles, relation: Relation, joint: int, q: Array) -> tuple[float, ...]:
    """All values of one joint, in (-pi, pi], at which a relation holds with the others where q has them; sorted."""
    rest = tuple(0 if k == joint else e for k, e in enumerate(relation.degrees))
    scale = _scale(relation)
    numbers = [_sum(half, p, rest, scale, q)[0] for p in coefficients(half, relation, joint)]
    size = max(abs(x) for x in numbers)
    if size == 0.0:
        return ()
    out = [pi] if abs(numbers[-1]) < REAL * size and joint in half.ring.circles else []
    top = next(i for i in range(len(numbers) - 1, -1, -1) if abs(numbers[i]) >= REAL * size)
    for root in np.roots(numbers[top::-1]):
        if abs(root.imag) < REAL * (1.0 + abs(root.real)):
            out.append(float(root.real) if joint in half.ring.slides else 2.0 * atan(root.real))
    return tuple(sorted(out))


def univariate_roots(half: HalfAngles, relation: Relation) -> tuple[float, ...]:
    """All roots in (-pi, pi] of a relation in one joint and no symbol, from enclosures that are proved; sorted."""
    (joint,) = relation.joints
    numbers = [0] * (relation.degrees[joint] + 1)
    for powers, number in relation.poly.terms():
        numbers[int(powers[joint])] = int(number)
    # Roots come with their powers, which the annotations of python-flint leave out
    found: Any = fmpz_poly(numbers).complex_roots()
    roots = [float(r.real) for r, _ in found if r.imag == 0]
    return tuple(sorted(r if joint in half.ring.slides else 2.0 * atan(r) for r in roots))


def real_point(half: HalfAngles, branch: LocusBranch, rng: np.random.Generator) -> Array | None:
    """A random configuration on a branch, one number a joint, or None where this try found none."""
    q: Array = rng.uniform(-pi, pi, half.size)
    for value in branch.values:
        q[value.joint] = angle(value, half)
    if not branch.relations:
        return q
    if len(branch.relations) == 1:
        relation = branch.relations[0]
        joint = int(rng.choice(relation.joints))
        roots = joint_roots(half, relation, joint, q)
        if not roots:
            return None
        q[joint] = rng.choice(roots)
        return q
    free = sorted({k for r in branch.relations for k in r.joints})

    def residual(x: Array) -> Array:
        at = q.copy()
        at[free] = x
        return np.array([form_value(half, r, at) for r in branch.relations] + [0.0] * len(free))

    # Imported here: it takes longer than all else that a command loads
    from scipy.optimize import least_squares

    found = least_squares(residual, q[free], xtol=1e-15, ftol=1e-15, gtol=1e-15, max_nfev=60)
    if np.abs(found.fun).max() > ZERO:
        return None
    q[free] = found.x
    return q
