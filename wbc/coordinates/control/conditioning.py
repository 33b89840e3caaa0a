"""Least singular values of groups of coordinates at a configuration, compiled, with their slopes along q."""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Sequence
from importlib import resources
from math import isfinite
from typing import Any

import casadi as ca
import numpy as np

from wbc import validation
from wbc.coordinates import expressions
from wbc.coordinates.chains import free_joints
from wbc.coordinates.rows import Coordinate, coordinates
from wbc.coordinates.scales import scales
from wbc.errors import CompileError, ShapeError
from wbc.native import toolchain
from wbc.native.compiled_function import generated_library
from wbc.native.library import load_library
from wbc.robot import Robot
from wbc.robot.robot import checked_robot
from wbc.symbolic.evaluation import SingleState
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
    # Not by a product of q with itself, which overflows with a warning where q does not
    if plain and isfinite(abs(q).max(initial=0.0)):
        out: Array = q
        return out
    return robot.configuration("q", q)


class Conditioning:
    """sigma_min of D_r J_g(q) D_c for groups g of coordinates, J_g their rates without the columns of braked joints,

        D_r = 1 / length for rows in metres, D_c = length for sliding joints, else 1;
        d sigma / dq = u' (dJ / dq) v,    u, v the singular vectors                        [per rad, or m]

    Args:
        brakes: names of the joints that stand still in each group; default: none.
        length: one for all rows [m]; default: of the arm that a row belongs to, see :func:`scales`.

    Attributes:
        groups: the coordinates of each. compiled: as C, else by numpy. dof_scale: D_c [nv].
    """

    def __init__(
        self,
        robot: Robot,
        groups: Sequence[Sequence[Coordinate]],
        *,
        brakes: Sequence[Sequence[str]] | None = None,
        length: float | None = None,
        backend: str = "auto",
    ) -> None:
        validation.one_of("backend", backend, ("auto", "native", "vm"))
        self.robot = checked_robot(robot)
        given = validation.items("groups", groups, "groups of coordinates")
        self.groups: tuple[tuple[Coordinate, ...], ...] = tuple(coordinates("groups", g) for g in given)
        if not self.groups:
            raise ShapeError("groups", groups, "expected one group of coordinates or several")
        if length is not None:
            length = validation.scalar("length", length, low=0.0, open_low=True, unit="m")
        every = tuple(dict.fromkeys(one for group in self.groups for one in group))
        for one in every:
            expressions.check(robot, "groups", one)
        labels = [expressions.labels(robot, one) for one in every]
        starts = dict(zip(every, np.cumsum([0, *map(len, labels)]).tolist(), strict=False))
        sizes = dict(zip(every, map(len, labels), strict=True))
        self._rows = [[starts[one] + k for one in group for k in range(sizes[one])] for group in self.groups]
        locked = [()] * len(self.groups) if brakes is None else validation.items("brakes", brakes, "names")
        self._columns = [free_joints(robot, validation.strings("brakes", names)) for names in locked]
        if len(self._columns) != len(self.groups) or not all(self._columns):
            raise ShapeError("brakes", brakes, "expected names of joints for each group, not of all joints")
        self._row_scale, self.dof_scale = scales(robot, every, length)
        self._functions = _functions(robot, every, len(self._row_scale))
        self._rates, self._slope = map(SingleState, self._functions)
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
        """The least singular value of each group.

        Raises:
            ShapeError, NotFiniteError, RotationError: no configuration.
        """
        self._q[:] = q = checked_configuration(self.robot, q)
        if self._native is None:
            return np.array([np.linalg.svd(J, compute_uv=False)[-1] for J in self.matrices(q)])
        at, sigma, _, _ = self._pointers
        self._native(at, None, sigma, None, None)
        return self._sigma.copy()

    def chosen(self, groups: Sequence[int]) -> Callable[[Array], Array]:
        """:meth:`sigmas` of some groups alone, given by their numbers, in that order; ``q`` is not checked there.

        Raises:
            ShapeError, RangeError: no such groups.
        """
        numbers = [self._number(group) for group in validation.items("groups", groups, "numbers of groups")]
        order = np.array(numbers, dtype=np.intp)
        if self._native is None:
            return lambda q: self.sigmas(q)[order]
        native, (at, sigma, _, _) = self._native, self._pointers
        wanted = np.zeros(len(self.groups), dtype=np.uint8)
        wanted[order] = 1
        # The array lives as long as the function that points into it
        flags = wanted.ctypes.data_as(ctypes.c_void_p)

        def some(q: Array) -> Array:
            self._q[:] = q
            native(at, flags, sigma, None, None)
            return self._sigma[order]

        return some

    def slopes(self, q: Array, group: int | None = None) -> tuple[Array, Array, Array]:
        """(least singular values, their derivatives along q [groups, nv], right singular vectors [groups, nv]).

        Args:
            group: the number of the one that is looked at; what the others have is then that of an earlier call.

        Raises:
            ShapeError, NotFiniteError, RotationError: no configuration.
        """
        self._q[:] = q = checked_configuration(self.robot, q)
        some = range(len(self.groups)) if group is None else (self._number(group),)
        if self._native is not None:
            at, *out = self._pointers
            wanted = np.zeros(len(self.groups), dtype=np.uint8)
            wanted[list(some)] = 1
            self._native(at, wanted.ctypes.data_as(ctypes.c_void_p), *out)
            return self._sigma.copy(), self._slopes.copy(), self._right.copy()
        matrices = self.matrices(q)
        for g in some:
            rows, columns = self._rows[g], self._columns[g]
            u, sigma, v = np.linalg.svd(matrices[g], full_matrices=False)
            left, right = np.zeros(len(self._row_scale)), self._right[g]
            left[rows] = u[:, -1] * self._row_scale[rows]
            right[:] = 0.0
            self._sigma[g], right[columns] = sigma[-1], v[-1]
            self._slopes[g] = self._slope(q, left, right * self.dof_scale)[0][:, 0]
        return self._sigma.copy(), self._slopes.copy(), self._right.copy()

    def size(self, q: Array, group: int) -> float:
        """Frobenius norm of the scaled matrix of a group: what its entries are rounded in proportion to."""
        return float(np.linalg.norm(self.matrices(q)[self._number(group)]))

    def _number(self, group: int) -> int:
        return validation.integer("group", group, high=len(self.groups) - 1)

    def matrices(self, q: Array) -> list[Array]:
        """The scaled matrix of each group, for checks."""
        q = checked_configuration(self.robot, q)
        every = self._row_scale[:, None] * self._rates(q)[0] * self.dof_scale
        return [every[np.ix_(rows, columns)] for rows, columns in zip(self._rows, self._columns, strict=True)]

    def many(self, states: Array) -> list[Array]:
        """The scaled matrices of each group at many configurations [states, rows, joints that are not braked]."""
        states = validation.ordinary_array("states", states)
        if states.ndim != 2 or states.shape[1] != self.robot.nq or not len(states):
            raise ShapeError("states", states, f"expected configurations side by side [states, {self.robot.nq}]")
        rates = np.array([self._rates(q)[0] for q in states])
        every = self._row_scale[:, None] * rates * self.dof_scale
        return [every[:, rows][:, :, columns] for rows, columns in zip(self._rows, self._columns, strict=True)]

    def _load(self, backend: str) -> ctypes._NamedFuncPointer | None:
        if not toolchain.available():
            return None
        text = self._source()
        try:
            library = generated_library(text, lambda: text)
        except CompileError as error:
            if backend == "native":
                raise
            toolchain.fall_back(str(error))
            return None
        found = load_library(library).conditioning
        found.restype = None
        return found

    def _source(self) -> str:
        generator = ca.CodeGenerator("rows.c", {"with_header": False})
        for function in self._functions:
            generator.add(function)
        most = max(map(len, self._rows))
        sizes = {
            "NV": self.robot.nv,
            "ROWS": len(self._row_scale),
            "GROUPS": len(self.groups),
            "MOST": most,
            "WORK_W": max(1, *(f.sz_w() for f in self._functions)),
            "WORK_IW": max(1, *(f.sz_iw() for f in self._functions)),
            "ARGUMENTS": max(f.sz_arg() + f.sz_res() for f in self._functions),
        }
        tables = [
            *(f"#define {name} {value}" for name, value in sizes.items()),
            *_table("row", self._rows),
            *_table("column", self._columns),
            f"static const double row_scale[] = {{{', '.join(x.hex() for x in self._row_scale.tolist())}}};",
            f"static const double dof_scale[] = {{{', '.join(x.hex() for x in self.dof_scale.tolist())}}};",
        ]
        own = resources.files("wbc.coordinates.control") / "native"
        texts = ((own / name).read_text() for name in ("singular.c", "least.c"))
        return "\n".join((str(generator.dump()), *tables, *texts))


def _table(name: str, lists: Sequence[Sequence[int]]) -> tuple[str, str]:
    """C arrays of numbers that each group has some of, and where those of a group begin."""
    starts = np.cumsum([0, *map(len, lists)]).tolist()
    numbers = [str(k) for some in lists for k in some]
    return (
        f"static const int {name}_start[] = {{{', '.join(map(str, starts))}}};",
        f"static const int group_{name}[] = {{{', '.join(numbers)}}};",
    )


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
