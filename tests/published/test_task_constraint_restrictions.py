"""Written restrictions of pairs against published determinants and loci, and against determinants by numbers:
E. Dupuis, PhD thesis, McGill University, 2001, chapter 4, eqs. (4.2) to (4.39) as corrected.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from functools import cache
from itertools import pairwise
from math import pi
from pathlib import Path

import numpy as np
import pytest

from tests.evaluation import quick
from wbc.coordinates import ClosedForm, CoordinatePair, closed_form, expressions, mode_pairs, parts, restriction_table

PAGE = (Path(__file__).parent / "data" / "written_restrictions.md").read_text()
ROBOTS = ("planar_3r", "spherical_4r", "ssrms_simplified", "ssrms", "spdm_arm_simplified", "spdm_arm", "spdm")
Function = Callable[[np.ndarray], float]
#: Steps of a way through joint space on which zeros are looked for
STEPS = 400
#: What a written condition is zero of, by what it says
CHOICES = {
    "= +-pi/2": np.cos,
    "in {0, pi}": np.sin,
    "in {-pi/2, 0, pi/2, pi}": lambda x: np.sin(2.0 * x),
}


@cache
def written(name: str) -> dict[str, ClosedForm]:
    """Pairs of M1 that have restrictions."""
    found = {pair: closed_form(parts(name).robot, pair) for pair in mode_pairs(name, "M1")}
    return {pair.name: form for pair, form in found.items() if form is not None}


def factor(line: str) -> Function:
    """What is zero where a line says."""
    choice = re.fullmatch(r"q(\d) (.*)", line)
    if choice and choice[2] in CHOICES:
        joint, function = int(choice[1]) - 1, CHOICES[choice[2]]
        return lambda q: float(function(q[joint]))
    solved = re.fullmatch(r"q(\d) = (?!0$)(.+)", line)
    if solved:
        joint, other = int(solved[1]) - 1, factor(f"{solved[2]} = 0")
        return lambda q: float(np.sin(0.5 * (q[joint] - other(q))))
    text = line.removesuffix(" = 0")
    assert text != line
    text = re.sub(r"(?<![\w/])(\d+) (?=[\w(])", r"\1 * ", text)
    text = re.sub(r"\b([cs])(\d+)\b", lambda m: _trig(m[1], m[2]), text)
    text = re.sub(r"(?<=\d) (?=q\d)", " * ", text)
    code = compile(re.sub(r"\bq(\d)\b", lambda m: f"q[{int(m[1]) - 1}]", text), line, "eval")
    return lambda q: float(eval(code, {"cos": np.cos, "sin": np.sin, "pi": pi}, {"q": q}))


def _trig(kind: str, digits: str) -> str:
    return f"{'cos' if kind == 'c' else 'sin'}({' + '.join(f'q{d}' for d in digits)})"


def zeros(function: Function, start: np.ndarray, way: np.ndarray) -> list[np.ndarray]:
    """Where a function changes its sign along start + t way, t from 0 to 1, by bisection."""
    ends = np.linspace(0.0, 1.0, STEPS + 1)
    values = [function(start + t * way) for t in ends]
    out = []
    for (a, b), (fa, fb) in zip(pairwise(ends), pairwise(values), strict=True):
        if fa * fb >= 0.0:
            continue
        low, high = a, b
        for _ in range(50):
            middle = 0.5 * (low + high)
            low, high = (middle, high) if fa * function(start + middle * way) > 0.0 else (low, middle)
        out.append(start + low * way)
    return out


def agree(lines: tuple[str, ...], other: Function, joints: int, ways: int) -> int:
    """Along ways through joint space either is zero where the other one is; returns how many zeros there were."""
    factors, rng, count = [factor(line) for line in lines], np.random.default_rng(4), 0
    size = np.median([abs(other(q)) for q in rng.uniform(-pi, pi, (50, joints))])
    for _ in range(ways):
        start, way = rng.uniform(-pi, pi, joints), rng.uniform(-4.0, 4.0, joints)
        for one, line in zip(factors, lines, strict=True):
            for q in zeros(one, start, way):
                assert abs(other(q)) < 1e-9 * size, (line, q)
                count += 1
        for q in zeros(other, start, way):
            assert min(abs(one(q)) for one in factors) < 1e-7, q
    return count


def determinant(name: str, pair: CoordinatePair) -> Function:
    """Of all rows of a pair; what is not of the first arm is anywhere."""
    robot, rng = parts(name).robot, np.random.default_rng(6)
    rates = quick(expressions.rate_function(robot, pair.rows))
    columns = [robot.dof_names.index(joint) for joint in parts(name).arms[0].joints]
    others = rng.uniform(-1.0, 1.0, robot.nv)

    def of(q: np.ndarray) -> float:
        whole = others.copy()
        whole[columns] = q
        return float(np.linalg.det(rates(whole)[0]))

    return of


@pytest.mark.parametrize("name", ROBOTS)
def test_the_page_has_what_is_written(name: str) -> None:
    assert f"`{name}`:\n\n{restriction_table(name)}\n" in PAGE


@pytest.mark.parametrize("name", ROBOTS)
def test_written_restrictions_are_where_determinants_vanish(name: str) -> None:
    pairs = {pair.name: pair for pair in mode_pairs(name, "M1")}
    joints = len(parts(name).arms[0].joints)
    assert len(written(name)) >= {"planar_3r": 2, "spherical_4r": 7}.get(name, 6)
    for pair, form in written(name).items():
        assert agree(form.lines, determinant(name, pairs[pair]), joints, 2) > 0, pair


def space_arm(L: float, D: float, wrist: float) -> dict[str, Function]:
    """Determinants of sections 4.4 to 4.6: D of the yaw joints' height, ``wrist`` that of x between F5 and F6."""
    c, s = np.cos, np.sin

    def sums(q: np.ndarray) -> tuple[float, ...]:
        return q[2] + q[3], q[3] + q[4], q[2] + q[3] + q[4]

    def roll(q: np.ndarray) -> float:
        a, _, b = sums(q)
        return float(c(q[5]) * s(q[3]) * (L * (c(q[2]) + c(a)) + D * s(b) + wrist * c(b)))

    def yaw(q: np.ndarray) -> float:
        a, _, b = sums(q)
        inner = L * (s(q[2]) + s(a)) + D * (1.0 - c(b)) + wrist * s(b)
        return float(c(q[1]) * c(q[5]) * s(q[3]) * inner)

    def alpha(q: np.ndarray) -> float:
        a, d, _ = sums(q)
        inner = 2.0 * L * (1.0 + c(q[3])) + D * (s(q[2]) + s(a) + s(q[4]) + s(d)) + wrist * (c(q[4]) + c(d))
        # Zero at q4 = pi as a whole, where its sign does not change: divided by 2 |cos(q4 / 2)|
        return float(c(q[1]) * c(q[5]) * s(q[3]) * inner / (2.0 * abs(c(q[3] / 2.0))))

    return {"joint1": roll, "joint2": yaw, "alpha": alpha}


@pytest.mark.parametrize(
    ("name", "published"),
    [
        ("ssrms_simplified", space_arm(7.11, 0.0, 0.0)),
        ("ssrms", space_arm(7.11, -0.7026, 0.0)),
        ("spdm_arm_simplified", space_arm(1.0, 0.0, 0.2)),
    ],
)
def test_written_restrictions_are_the_published_ones(name: str, published: dict[str, Function]) -> None:
    """(4.21), (4.30) to (4.32), (4.36), (4.37), (4.39): locks of the shoulder and the pitch plane."""
    for constraint, formula in published.items():
        assert agree(written(name)[f"xi | {constraint}"].lines, formula, 7, 3) > 5, constraint


def test_what_no_pair_of_the_planar_arm_can_do_is_published() -> None:
    """(3.24), (3.55): with either coordinate of the middle the arm is deficient where q2, q3 in {0, pi}, and only there
    with both.
    """
    both = [factor(line) for form in written("planar_3r").values() for line in form.lines]
    for q2, q3 in ((0.0, 0.0), (0.0, pi), (pi, 0.0), (pi, pi)):
        assert max(abs(one(np.array([0.4, q2, q3]))) for one in both) < 1e-12
    for q in np.random.default_rng(8).uniform(-pi, pi, (200, 3)):
        assert max(abs(one(q)) for one in both) > 1e-3


def test_what_the_elbow_of_the_spherical_arm_cannot_do_is_published() -> None:
    """(4.8) of the pitch plane as it is; (4.4) of the elbow where all three coordinates of it fail."""
    forms = written("spherical_4r")
    assert forms["tip | alpha"].lines == ("q2 = +-pi/2", "q4 in {0, pi}")
    elbow = [[factor(line) for line in forms[f"tip | elbow {axis}"].lines] for axis in "xyz"]
    rng = np.random.default_rng(9)
    for joint, values in ((1, (pi / 2, -pi / 2)), (3, (0.0, pi))):
        for value in values:
            q = rng.uniform(-pi, pi, 4)
            q[joint] = value
            assert all(min(abs(one(q)) for one in lines) < 1e-12 for lines in elbow)
    for q in rng.uniform(-pi, pi, (200, 4)):
        assert max(min(abs(one(q)) for one in lines) for lines in elbow) > 1e-3
