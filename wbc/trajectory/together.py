"""Laws of many motions at once, on all cores."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from typing import Any, overload

import numpy as np

from wbc.cores import cores
from wbc.errors import RangeError, ShapeError, WbcError
from wbc.extras import MissingPackageError
from wbc.trajectory.laws.law import Law, State
from wbc.validation import Array

#: Motions that a process takes at a time, of those that each would have: so many times
_TURNS = 8

Made = Law | WbcError


class Laws(Sequence[Law]):
    """n laws, in the order of their motions; made by :func:`many`.

    Attributes:
        errors: by number, why a motion has no law.
        durations: of each [s], n; inf where there is none.

    Raises:
        ShapeError: no sequence.
    """

    def __init__(self, made: Sequence[Made]) -> None:
        if not isinstance(made, Sequence):
            raise ShapeError("made", made, "expected a list of laws, and errors of what has none")
        self._made = tuple(made)
        self.errors = {k: one for k, one in enumerate(self._made) if isinstance(one, WbcError)}
        self.durations: Array = np.array([one.duration if isinstance(one, Law) else np.inf for one in self._made])

    def __len__(self) -> int:
        return len(self._made)

    @overload
    def __getitem__(self, number: int) -> Law: ...
    @overload
    def __getitem__(self, number: slice) -> Laws: ...
    def __getitem__(self, number: int | slice) -> Law | Laws:
        """One law, or some of them.

        Raises:
            WbcError: why there is none.
        """
        if isinstance(number, slice):
            return Laws(self._made[number])
        found = self._made[number]
        if isinstance(found, WbcError):
            raise found.within(f"motion {number}")
        return found

    def __iter__(self) -> Iterator[Law]:
        return (self[k] for k in range(len(self)))

    def at(self, time: Any) -> State:
        """Positions, velocities and accelerations [n, m, ...] at one time [n, ...] or at m times [s]; a law that has
        ended stands.

        Raises:
            WbcError: why a motion has no law. NotFiniteError, ShapeError: no times, or no laws.
        """
        if not len(self):
            raise ShapeError("laws", len(self), "there are none")
        states = [law.at(time) for law in self]
        return State(*(np.stack(parts) for parts in zip(*states, strict=True)))

    def __repr__(self) -> str:
        return f"<{len(self)} laws, {len(self.errors)} of them impossible>"


def many(law: Callable[..., Law], *motions: Any, processes: int | None = None, **common: Any) -> Laws:
    """Laws of n motions, each as a call of its own makes it, bit for bit and whatever the number of processes is.

        laws = many(jerk_limited, starts, targets, velocity=2.0, acceleration=10.0, jerk=100.0)    # [n, dof] each
        laws = many(time_optimal, waypoints, velocity=2.0, acceleration=10.0)                      # [n, points, dof]
        laws.durations, laws.at(np.arange(0.0, 2.0, 0.01)).position                                # [n], [n, 200, dof]

    A motion without a law does not end the others: see :attr:`Laws.errors`.
    ``law`` and what is common go to other processes, so no lambda; with ``processes=1`` anything does.

    Args:
        law: what makes one law, of this package or the user's own.
        motions: its positional arguments: arrays with an axis of n first, or sequences of n.
        processes: at a time; default: one a core.
        common: arguments of all.

    Raises:
        ShapeError: no function; arguments of different n, or none. RangeError: no number of processes.
        MissingPackageError: the law needs a package that is not installed.
    """
    if not callable(law):
        raise ShapeError("law", law, "expected a function that makes a law")
    if not motions:
        raise ShapeError("motions", motions, "expected arrays with an axis of motions first")
    count = len(motions[0]) if hasattr(motions[0], "__len__") else -1
    for k, each in enumerate(motions):
        if not hasattr(each, "__len__") or len(each) != count:
            raise ShapeError(f"motions[{k}]", each, f"expected {max(count, 1)} motions, as many as of the first")
    if processes is not None and (isinstance(processes, bool) or not isinstance(processes, int) or processes < 1):
        raise RangeError("processes", processes, "expected an integer from 1 on")
    at_work = min(processes or cores(), count)
    tasks = [(law, tuple(each[k] for each in motions), common) for k in range(count)]
    if at_work <= 1:
        return Laws([_made(task) for task in tasks])
    with ProcessPoolExecutor(at_work) as pool:
        try:
            return Laws(list(pool.map(_made, tasks, chunksize=max(1, count // (_TURNS * at_work)))))
        except BaseException:
            pool.shutdown(wait=True, cancel_futures=True)
            raise


def _made(task: tuple[Callable[..., Law], tuple[Any, ...], dict[str, Any]]) -> Made:
    law, own, common = task
    try:
        return law(*own, **common)
    except MissingPackageError:
        # No law of any motion can be made
        raise
    except WbcError as error:
        return error
