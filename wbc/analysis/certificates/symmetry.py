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
    fewest = sorted(forms, key=lambda f: f.terms)
    found = []
    for choice in product((1, -1), repeat=len(joints)):
        signs = np.ones(size, int)
        signs[list(joints)] = choice
        images = [_image(form, signs) for form in fewest]
        known = [image for image in images if image is not None]
        if len(known) < len(images):
            continue
        for halves in product((0, 1), repeat=len(joints)):
            turns = np.zeros(size, int)
            turns[list(joints)] = halves
            if all(_unchanged(form, image, turns) for form, image in zip(fewest, known, strict=True)):
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


def _unchanged(form: TrigForm, image: tuple[Array, Array], turns: Array) -> bool:
    """Whether M(moved q) = R M(q) C with diagonal R, C of signs."""
    to, turned = image
    flip = np.where((form.waves.astype(int) @ turns) % 2, -1, 1)
    cosine, sine = np.zeros_like(form.cosine), np.zeros_like(form.sine)
    cosine[:, to], sine[:, to] = flip * form.cosine, flip * turned * form.sine
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
