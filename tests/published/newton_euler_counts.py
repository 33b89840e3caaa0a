"""Operations in one step by the thesis, chapter 7: multiplications with divisions, additions with subtractions."""

from __future__ import annotations

from fractions import Fraction

from wbc import validation

#: Part -> coefficients of 1, n, n^2, ... and their common divisor, of multiplications and of additions
PARTS = {
    "nominal torque": (((0, 185, 97), 2), ((0, 105, 61), 2)),
    "linearised model": (((0, 360, 2749, 1005, 56), 6), ((0, 156, 956, 393, 28), 3)),
    "discretisation": (((3, 0, 8, 28), 1), ((0, 4, -6, 28), 1)),
    "optimum": (((0, 0, 20, 21, 1), 3), ((0, -24, 25, 39, 2), 6)),
    "sum of torques": (((0,), 1), ((0, 1), 1)),
    "estimation": (((0, 25, 39), 2), ((0, 3, 51), 2)),
}
#: Controller -> its parts
CONTROLLERS = {
    "linearised": ("nominal torque", "linearised model", "discretisation", "optimum", "sum of torques"),
    "adaptive": ("nominal torque", "estimation", "optimum", "sum of torques"),
}
#: Totals as printed; the 3 of the discretisation is missing in the first
PRINTED = {
    "linearised": (((0, 915, 3128, 1215, 58), 6), ((0, 633, 2084, 993, 58), 6)),
    "adaptive": (((0, 315, 224, 21, 1), 3), ((0, 306, 361, 39, 2), 6)),
}
Polynomial = tuple[tuple[int, ...], int]


def operations(part: str, n: int) -> tuple[int, int]:
    """Multiplications and additions of a part, or of a controller by the sum of its parts."""
    validation.one_of("part", part, (*PARTS, *CONTROLLERS))
    pairs = [_pair(PARTS[name], n) for name in CONTROLLERS.get(part, (part,))]
    return sum(pair[0] for pair in pairs), sum(pair[1] for pair in pairs)


def printed_total(controller: str, n: int) -> tuple[int, int]:
    """Multiplications and additions of a controller by the printed total."""
    return _pair(PRINTED[validation.one_of("controller", controller, PRINTED)], n)


def _pair(polynomials: tuple[Polynomial, Polynomial], n: int) -> tuple[int, int]:
    validation.integer("n", n, low=1)
    first, second = (
        sum(Fraction(c * n**k, divisor) for k, c in enumerate(coefficients)) for coefficients, divisor in polynomials
    )
    return int(first), int(second)
