"""Symmetries of Jacobians: reflections of joints and half turns under which they only change signs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np

from wbc.analysis.algebra.trig_form import TrigForm
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
        signs = np.ones(size, int)
        signs[list(joints)] = choice
        images = [_image(form, signs) for form in forms]
        known = [image for image in images if image is not None]
        if len(known) < len(images):
            continue
        for halves in _half_turns(forms, known, joints):
            turns = np.zeros(size, int)
            turns[list(joints)] = halves
            found.append(Symmetry(tuple(signs.tolist()), tuple(turns.tolist())))
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


def _image(form: TrigForm, signs: Array) -> tuple[Array, Array] | None:
    """(wave that each becomes, sign of its sine) where joints are reflected; None where sizes of coefficients differ.

    Half turns and signs of rows and columns change no size.
    """
    waves = form.waves.astype(int)
    image = waves * signs
    first = image[np.arange(len(image)), (image != 0).argmax(axis=1)]
    turned = np.where(first < 0, -1, 1)
    base = (2 * np.abs(waves).max(initial=0) + 1) ** np.arange(waves.shape[1])
    keys, wanted = waves @ base, (image * turned[:, None]) @ base
    order = np.argsort(keys)
    to = order[np.minimum(np.searchsorted(keys[order], wanted), len(keys) - 1)]
    if (keys[to] != wanted).any():
        return None
    for part in (form.cosine, form.sine):
        if np.abs(np.abs(part[:, to]) - np.abs(part)).max(initial=0.0) > SAME * np.abs(part).max(initial=0.0):
            return None
    return to, turned


def _half_turns(
    forms: Sequence[TrigForm], images: Sequence[tuple[Array, Array]], joints: Sequence[int]
) -> list[tuple[int, ...]]:
    """All turns with M(moved q) = R M(q) C for each matrix, R and C diagonal matrices of signs.

    A coefficient of wave w in entry ij that becomes itself by a sign (-1)^b needs w . turns + r_i + c_j = b modulo 2:
    equations over the field of two elements, as bits of whole numbers, turns in the lowest ones.
    """
    count = len(joints)
    equations, first = set[int](), count
    for form, (to, turned) in zip(forms, images, strict=True):
        rows, columns = form.shape
        least = SAME * max(np.abs(form.cosine).max(initial=0.0), np.abs(form.sine).max(initial=0.0))
        odd = (form.waves[:, list(joints)].astype(np.int64) % 2) @ (1 << np.arange(count))
        for part, signs in ((form.cosine, np.ones_like(turned)), (form.sine, turned)):
            entry, wave = np.nonzero(np.abs(part) > least)
            changed = signs[wave] * part[entry, wave] * part[entry, to[wave]] < 0.0
            own = (np.int64(1) << (first + entry // columns)) + (np.int64(1) << (first + rows + entry % columns))
            equations |= set((2 * (odd[wave] + own) + changed).tolist())
        first += rows + columns
    solved: dict[int, int] = {}
    for equation in equations:
        while equation > 1 and (known := solved.get(equation.bit_length())) is not None:
            equation ^= known
        if equation == 1:
            return []
        if equation:
            solved[equation.bit_length()] = equation
    of_turns = [e for e in solved.values() if e.bit_length() <= count + 1]
    return [
        halves
        for halves in product((0, 1), repeat=count)
        if not any((e & (1 + sum(2 << k for k in range(count) if halves[k]))).bit_count() % 2 for e in of_turns)
    ]
