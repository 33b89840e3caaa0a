"""The controller as users know it: a compiled stack, with what is made of one."""

from __future__ import annotations

import os
import pathlib
from typing import TYPE_CHECKING

from wbc.controller.compiled_stack import CompiledStack
from wbc.errors import SolverError

if TYPE_CHECKING:
    from wbc.batch import Batch
    from wbc.record.recorder import Recorder


class Controller(CompiledStack):
    """A compiled stack with its run-time values. Made by :meth:`wbc.Stack.compile`.

    Each controller has its own memory, see :meth:`clone`; one controller must not be stepped from two threads at once.

    Attributes:
        stack: the declaration that it was compiled from.
        solver: name of the QP solver.
        cached: the compiled stack was found in the cache.
    """

    def record(self, path: str | os.PathLike[str], *, overwrite: bool = False) -> Recorder:
        """Record every tick into a file from now on, until the recorder is closed; see :func:`wbc.replay`.

        Args:
            overwrite: a file that is there may be replaced.

        Raises:
            RecordingError: the file is there or cannot be written, or the controller records already.
            SolverError: its policy has an escape.
        """
        if self.policy.escape:
            raise SolverError("record", self.policy, "a recording holds no escape; set a policy without it")
        from wbc.record.recorder import record

        return record(self, path, overwrite)

    def batch(self, count: int, *, threads: int | None = None) -> Batch:
        """Many robots, or candidate states, of this compiled stack, which tick in one call; docs/batch.md.

            batch = controller.batch(10_000)
            batch.set(hand=poses)                   # [10_000, 4, 4]
            v = batch.step(q).v                     # [10_000, nq] -> [10_000, nv]

        It waits for native code in the making, see :meth:`wbc.Stack.compile`.

        Args:
            count: how many. threads: that tick at a time; default: one a core.

        Raises:
            RangeError: not an integer >= 1. SolverError: the stack measures distances, or its policy has an escape.
        """
        from wbc.batch import Batch

        return Batch(self.settled(), count, threads)

    def export(
        self,
        folder: str | os.PathLike[str],
        *,
        overwrite: bool = False,
        solver_source: bool | str | os.PathLike[str] = False,
        states: int = 1000,
    ) -> pathlib.Path:
        """Write the tick as self-contained C99, with its QP solver, a header, build files and a check.

            controller.reset(q)
            controller.export("arm_tick")           # then: make -C arm_tick run

        The values that the controller has now (targets, gains, weights, switches, the cap) are those that the C code
        begins with. Nothing is compiled, and any backend will do; the C code is the native tick. docs/export.md.

        Args:
            folder: where to; it must be empty or not there.
            overwrite: an export that is there is replaced.
            solver_source: the solver's source in place of the library for this platform: True fetches it from the
                package index, or the path of its archive. Its hash is checked.
            states: how many states the check has, with this controller's commands; other backends than the native one
                give those of them that they solve with certainty.

        Raises:
            ExportError: the folder is not empty or cannot be written.
            SolverError: run-time values still wait for the first configuration.
            SolverSourceError: the solver cannot be had. RangeError: ``states`` is no integer >= 1.
        """
        from wbc.export import export

        return pathlib.Path(export(self, folder, overwrite, solver_source, states))
