"""Functions whose symbols are their inputs, and where the entries of their rows are."""

from __future__ import annotations

import casadi as ca
import numpy as np

from wbc.errors import ShapeError


def shared_pattern(transposed: ca.SX) -> ca.SX:
    """Give all rows of a task the same columns, if that at most doubles the entries: they are then one dense block."""
    rows = transposed.shape[1]
    columns = sorted(set(transposed.sparsity().row()))
    if rows < 2 or len(columns) * rows > 2 * transposed.nnz():
        return transposed
    return ca.project(transposed, ca.Sparsity.rowcol(columns, list(range(rows)), transposed.shape[0], rows))


def sparsity_rows(transposed: ca.Sparsity) -> tuple[np.ndarray, np.ndarray]:
    """(starts, columns) of the rows of J from the sparsity of its transpose (compressed columns)."""
    return np.array(transposed.colind(), dtype=np.int64), np.array(transposed.row(), dtype=np.int64)


def checked_function(name: str, inputs: list[ca.SX], outputs: list[ca.SX], labels: list[str]) -> ca.Function:
    """A function of (q, v, p, dt, pull), as many of them as there are inputs.

    Raises:
        ShapeError: symbols that are no inputs.
    """
    free = ca.symvar(ca.veccat(*outputs))
    known = {s.__hash__() for s in ca.symvar(ca.veccat(*inputs))}
    stray = [s.name() for s in free if s.__hash__() not in known]
    if stray:
        raise ShapeError(f"stack.{name}", stray, "an item's expression contains symbols that are not its inputs")
    return ca.Function(name, inputs, ca.cse(outputs), ["q", "v", "p", "dt", "pull"][: len(inputs)], labels)
