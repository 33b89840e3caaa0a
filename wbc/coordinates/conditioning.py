"""Least singular values of groups of coordinates at a configuration, compiled, with their slopes along q."""

from __future__ import annotations

import ctypes
import hashlib
import pathlib
from collections.abc import Sequence
from importlib import resources
from math import isfinite
from typing import Any

import casadi as ca
import numpy as np

from wbc import validation
from wbc.controller.library import load_library
from wbc.coordinates import expressions
from wbc.coordinates.rows import Coordinate
from wbc.errors import CompileError, ShapeError
from wbc.robot import Robot
from wbc.stack import cache, toolchain
from wbc.symbolic.kinematics import Kinematics
from wbc.symbolic.tracer import Tracer
from wbc.validation import Array

#: Singular values below this count as lost, where nothing else is said [1]
LEAST = 1e-2


def checked_configuration(robot: Robot, q: Any) -> Array:
    """A configuration that was checked; arrays of plain coordinates in some tens of microseconds less.

    Raises:
        ShapeError, NotFiniteError, RotationError: none.
    """
    plain = type(q) is np.ndarray and q.dtype == np.float64 and q.shape == (robot.nq,) and robot.nq == robot.nv
    if plain and isfinite(q.dot(q)):
        out: Array = q
        return out
    return robot.configuration("q", q)


class Conditioning:
    """sigma_min of D_r J_g(q) D_c for groups g of coordinates, J_g their rates, with

        D_r = 1 / length for rows in metres, D_c = length for sliding joints, else 1;
        d sigma / dq = u' (dJ / dq) v,    u, v the singular vectors                        [per rad, or m]

    Attributes:
        groups: the coordinates of each. length: characteristic length [m]. compiled: as C, else by numpy.
    """

    def __init__(
        self,
        robot: Robot,
        groups: Sequence[Sequence[Coordinate]],
        *,
        length: float | None = None,
        backend: str = "auto",
    ) -> None:
        validation.one_of("backend", backend, ("auto", "native", "vm"))
        self.robot, self.groups = robot, tuple(tuple(g) for g in groups)
        if not self.groups or not all(self.groups):
            raise ShapeError("groups", groups, "expected one group of coordinates or several")
        chosen = robot.characteristic_length if length is None else length
        self.length = validation.scalar("length", chosen, low=0.0, open_low=True, unit="m")
        every = tuple(dict.fromkeys(one for group in self.groups for one in group))
        labels = [expressions.labels(robot, one) for one in every]
        starts = dict(zip(every, np.cumsum([0, *map(len, labels)]).tolist(), strict=False))
        sizes = dict(zip(every, map(len, labels), strict=True))
        self._rows = [[starts[one] + k for one in group for k in range(sizes[one])] for group in self.groups]
        units = [row.unit for some in labels for row in some]
        self._row_scale = np.array([1.0 / self.length if unit == "m" else 1.0 for unit in units])
        self._dof_scale = np.array([self.length if unit == "m" else 1.0 for unit in robot.dof_units])
        self._rates, self._slope = _functions(robot, every, len(units))
        self._native = self._load(backend) if backend != "vm" else None
        if backend == "native" and self._native is None:
            raise CompileError("backend", backend, f"cannot compile: {', '.join(toolchain.missing())}")
        self.compiled = self._native is not None
        count, nv = len(self.groups), robot.nv
        self._q, self._sigma = np.zeros(robot.nq), np.zeros(count)
        self._slopes, self._right = np.zeros((count, nv)), np.zeros((count, nv))
        self._pointers = tuple(
            ctypes.c_void_p(a.ctypes.data) for a in (self._q, self._sigma, self._slopes, self._right)
        )

    def sigmas(self, q: Array) -> Array:
        """The least singular value of each group; ``q`` is not checked."""
        self._q[:] = q
        if self._native is None:
            return np.array([np.linalg.svd(J, compute_uv=False)[-1] for J in self.matrices(q)])
        self._native(self._pointers[0], self._pointers[1], None, None)
        return self._sigma.copy()

    def slopes(self, q: Array) -> tuple[Array, Array, Array]:
        """(least singular values, their derivatives along q [groups, nv], right singular vectors [groups, nv])."""
        self._q[:] = q
        if self._native is not None:
            self._native(*self._pointers)
            return self._sigma.copy(), self._slopes.copy(), self._right.copy()
        for g, (rows, J) in enumerate(zip(self._rows, self.matrices(q), strict=True)):
            u, sigma, v = np.linalg.svd(J, full_matrices=False)
            left = np.zeros(len(self._row_scale))
            left[rows] = u[:, -1] * self._row_scale[rows]
            self._sigma[g], self._right[g] = sigma[-1], v[-1]
            self._slopes[g] = np.asarray(self._slope(q, left, v[-1] * self._dof_scale).full()).ravel()
        return self._sigma.copy(), self._slopes.copy(), self._right.copy()

    def matrices(self, q: Array) -> list[Array]:
        """The scaled matrix of each group, for checks."""
        every = self._row_scale[:, None] * np.asarray(self._rates(q).full()) * self._dof_scale
        return [every[rows] for rows in self._rows]

    def many(self, states: Array) -> list[Array]:
        """The scaled matrices of each group at many configurations [states, rows, nv]."""
        rates = self._rates.map(len(states))(states.T).full()
        every = rates.reshape(len(self._row_scale), len(states), self.robot.nv).swapaxes(0, 1)
        every = self._row_scale[:, None] * every * self._dof_scale
        return [every[:, rows] for rows in self._rows]

    def _load(self, backend: str) -> ctypes._NamedFuncPointer | None:
        if not toolchain.available():
            return None
        text = self._source()
        name = hashlib.sha256(f"{text}\n{toolchain.identity()}".encode()).hexdigest()

        def fill(folder: pathlib.Path) -> None:
            toolchain.compile_rows(text, folder / "least.so")

        try:
            folder, _ = cache.fetch(name, fill, library=True)
        except CompileError as error:
            if backend == "native":
                raise
            toolchain.fall_back(str(error))
            return None
        found = load_library(folder / "least.so").conditioning
        found.restype = None
        return found

    def _source(self) -> str:
        generator = ca.CodeGenerator("rows.c", {"with_header": False})
        functions = (self._rates, self._slope)
        for function in functions:
            generator.add(function)
        starts = np.cumsum([0, *map(len, self._rows)]).tolist()
        most = max(self.robot.nv, *map(len, self._rows))
        sizes = {
            "NV": self.robot.nv,
            "ROWS": len(self._row_scale),
            "GROUPS": len(self.groups),
            "MOST": most,
            "WORK_W": max(1, *(f.sz_w() for f in functions)),
            "WORK_IW": max(1, *(f.sz_iw() for f in functions)),
            "ARGUMENTS": max(f.sz_arg() + f.sz_res() for f in functions),
        }
        tables = [
            *(f"#define {name} {value}" for name, value in sizes.items()),
            f"static const int group_start[] = {{{', '.join(map(str, starts))}}};",
            f"static const int group_row[] = {{{', '.join(str(r) for rows in self._rows for r in rows)}}};",
            f"static const double row_scale[] = {{{', '.join(x.hex() for x in self._row_scale.tolist())}}};",
            f"static const double dof_scale[] = {{{', '.join(x.hex() for x in self._dof_scale.tolist())}}};",
        ]
        own = (resources.files("wbc.coordinates") / "native" / "least.c").read_text()
        return "\n".join((str(generator.dump()), *tables, own))


def _functions(robot: Robot, every: tuple[Coordinate, ...], count: int) -> tuple[ca.Function, ca.Function]:
    """``rates`` (q -> matrix of all rows) and ``slope`` (q, left, right -> derivative of left' matrix right)."""
    kin = Tracer(Kinematics(robot.model))
    parts = [ca.densify(expressions.matrix(robot, kin, one)) for one in every]
    matrix = kin.expand(ca.vertcat(*parts))
    left, right = ca.SX.sym("left", count), ca.SX.sym("right", robot.nv)
    slope = ca.densify(kin.kinematics.derivative(left.T @ matrix @ right).T)
    return (
        ca.Function("rates", [kin.q], [ca.cse(matrix)], ["q"], ["A"]),
        ca.Function("slope", [kin.q, left, right], [ca.cse(slope)], ["q", "left", "right"], ["g"]),
    )
