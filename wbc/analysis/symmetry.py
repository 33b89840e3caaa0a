"""Symmetries of Jacobians: reflections of joints and half turns under which they only change signs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np

from wbc.analysis.trig_form import TrigForm
from wbc.validation import Array

#: Coefficients that are this near, relative to the largest, are the same up to their rounding
SAME = 1e-14


@dataclass(frozen=True)
class Symmetry:
    """q_i -> sign_i q_i + pi turn_i.

    Attributes:
        signs: 1 or -1, one a joint. turns: 0 or 1, one a joint.
    """

    signs: tuple[int, ...]
    turns: tuple[int, ...]


def symmetries(forms: Sequence[TrigForm], joints: Sequence[int]) -> tuple[Symmetry, ...]:
    """Those that change each matrix only by signs of rows and columns, which change no singular value.

    Compared are the coefficients, not values at some configurations.
    """
    size = forms[0].waves.shape[1]
    found = []
    for choice in product((1, -1), repeat=len(joints)):
        for halves in product((0, 1), repeat=len(joints)):
            signs, turns = [1] * size, [0] * size
            for k, s, h in zip(joints, choice, halves, strict=True):
                signs[k], turns[k] = s, h
            moved = Symmetry(tuple(signs), tuple(turns))
            if all(_unchanged(form, moved) for form in sorted(forms, key=lambda f: f.terms)):
                found.append(moved)
    return tuple(found)


def fundamental_box(found: Sequence[Symmetry], joints: Sequence[int]) -> tuple[Array, Array]:
    """(centre, half widths) of a box that, with its images under the symmetries, is all of joint space.

    Joints that are not named have no width. A symmetry that keeps the box and turns one joint's interval onto itself,
    or shifts a full circle by half, lets half of that interval stand for all of it.
    """
    size = len(found[0].signs)
    centre, half = np.zeros(size), np.zeros(size)
    half[list(joints)] = np.nextafter(np.pi, 4.0)
    halved = True
    while halved:
        halved = False
        for moved, k in product(found, joints):
            if all(_kept(moved, j, centre, half) for j in joints) and _halves(moved, k, centre, half):
                half[k] /= 2.0
                centre[k] -= half[k]
                halved = True
                break
    return centre, half


def _kept(moved: Symmetry, k: int, centre: Array, half: Array) -> bool:
    """Whether an interval is its own image."""
    if half[k] > 3.0:
        return True
    image = moved.signs[k] * centre[k] + np.pi * moved.turns[k] - centre[k]
    return bool(abs(np.remainder(image + np.pi, 2 * np.pi) - np.pi) < 1e-9)


def _halves(moved: Symmetry, k: int, centre: Array, half: Array) -> bool:
    """Whether one half of the interval is the image of the other one."""
    if half[k] > 3.0:
        # Of a full circle [-pi, 0] is kept: a reflection at 0 or a shift by pi gives the rest
        return moved.signs[k] == (1 if moved.turns[k] else -1)
    return moved.signs[k] == -1


def _unchanged(form: TrigForm, moved: Symmetry) -> bool:
    """Whether M(moved q) = R M(q) C with diagonal R, C of signs."""
    place = {tuple(w): k for k, w in enumerate(form.waves.astype(int).tolist())}
    cosine, sine = np.zeros_like(form.cosine), np.zeros_like(form.sine)
    for k, wave in enumerate(form.waves.astype(int)):
        image = wave * np.array(moved.signs)
        flip = -1 if int(wave @ np.array(moved.turns)) % 2 else 1
        first = next((x for x in image if x), 1)
        to = place.get(tuple((image * (1 if first > 0 else -1)).tolist()))
        if to is None:
            return False
        cosine[:, to] += flip * form.cosine[:, k]
        sine[:, to] += flip * form.sine[:, k] * (1 if first > 0 else -1)
    before = np.hstack((form.cosine, form.sine))
    after = np.hstack((cosine, sine))
    size = SAME * np.abs(before).max(initial=0.0)
    same = np.abs(after - before).max(1, initial=0.0) <= size
    opposite = np.abs(after + before).max(1, initial=0.0) <= size
    empty = same & opposite
    if not (same | opposite).all():
        return False
    signs = np.where(empty, 0, np.where(same, 1, -1)).reshape(form.shape)
    return _product_of_signs(signs)


def _product_of_signs(signs: Array) -> bool:
    """Whether signs_ij = r_i c_j wherever it is not zero, for some signs r and c."""
    rows, columns = np.zeros(signs.shape[0], int), np.zeros(signs.shape[1], int)
    for start in range(len(rows)):
        if rows[start]:
            continue
        rows[start] = 1
        waiting = [(True, start)]
        while waiting:
            is_row, i = waiting.pop()
            line, mine, others = (signs[i], rows, columns) if is_row else (signs[:, i], columns, rows)
            for j in np.flatnonzero(line):
                expected = line[j] * mine[i]
                if others[j] == 0:
                    others[j] = expected
                    waiting.append((not is_row, int(j)))
                elif others[j] != expected:
                    return False
    return True
