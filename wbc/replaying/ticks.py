"""The ticks of a recording again, bit for bit."""

from __future__ import annotations

import dataclasses
import io
import os
import pickle
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from wbc import validation
from wbc.api import Controller, Stack
from wbc.controller import core_of
from wbc.controller.policy import Policy
from wbc.controller.step import Step
from wbc.errors import PicklingError, ShapeError
from wbc.record.recorder import about, declaration_key, recorded_inputs
from wbc.record.recording import Recording, RecordingError
from wbc.stack.artifact import BACKENDS
from wbc.stack.declaration import Declaration
from wbc.tick.outcome import STATUSES
from wbc.validation import Array

_PLACES = (
    *("wbc.tasks.", "wbc.robot.", "wbc.shapes", "wbc.stack.declaration", "wbc.api.stack"),
    *("wbc.coordinates.items", "wbc.coordinates.rows", "wbc.coordinates.point_sets", "wbc.analysis.rows"),
    *("wbc.climb.loop.stack", "wbc.climb.contacts"),
)
#: Models and poses where Pinocchio is not installed; all classes there are values
_ALGEBRA = "wbc.multibody."
_OTHERS = {
    ("numpy", "ndarray"),
    ("numpy", "dtype"),
    ("numpy._core.multiarray", "_reconstruct"),
    ("numpy._core.multiarray", "scalar"),
    ("numpy.core.multiarray", "_reconstruct"),
    ("numpy.core.multiarray", "scalar"),
    ("pinocchio.pinocchio_pywrap_default", "Model"),
    ("pinocchio.pinocchio_pywrap_default", "SE3"),
}


class _Careful(pickle.Unpickler):
    def find_class(self, module: str, name: str) -> Any:
        if (module, name) in _OTHERS:
            return super().find_class(module, name)
        if module.startswith((*_PLACES, _ALGEBRA)) and "." not in name:
            found = super().find_class(module, name)
            if module.startswith(_ALGEBRA) and isinstance(found, type) and found.__module__ == module:
                return found
            declares = isinstance(found, type) and (dataclasses.is_dataclass(found) or issubclass(found, Declaration))
            if declares and found.__module__ == module:
                return found
        reason = "the pickle asks for code that is not this package's; trust it, or give the stack"
        raise PicklingError("stack", f"{module}.{name}", reason)


def load_stack(data: bytes, *, trust: bool = False) -> Declaration:
    """The stack in a pickle.

    Args:
        trust: look up and run whatever the pickle says: needed for items and functions of the user's own, and safe only
            where the file is.

    Raises:
        PicklingError: it holds something else, is damaged, or needs ``trust``.
    """
    try:
        stack = pickle.loads(data) if trust else _Careful(io.BytesIO(data)).load()
    except PicklingError:
        raise
    except Exception as error:
        raise PicklingError(
            "stack", len(data), f"the pickle cannot be read: {type(error).__name__}: {error}"
        ) from error
    if not isinstance(stack, Declaration):
        raise PicklingError("stack", type(stack).__name__, "the pickle holds no stack")
    return stack


@dataclass(frozen=True, eq=False)
class ReplayedTick:
    """A recorded tick and its replay.

    Attributes:
        number: from 0. recorded: the command then [nv]. status: how the tick ended then. step: what it is now.
    """

    number: int
    recorded: Array
    status: str
    step: Step

    @property
    def identical(self) -> bool:
        """Every bit of the command and the status are as recorded."""
        return self.step.command.tobytes() == self.recorded.tobytes() and self.step.status == self.status

    @property
    def difference(self) -> float:
        """Largest |v - v recorded| of any degree of freedom [rad/s, m/s]."""
        return float(np.abs(self.step.command - self.recorded).max(initial=0.0))


@dataclass(frozen=True, eq=False)
class Replay:
    """The outcome of a replay.

    Attributes:
        ticks: how many were replayed.
        differing: how many are not bit-identical.
        first: the first of those, or None.
        worst: the tick with the largest difference, or None.
        backend: what replayed them.
        complete: the recording was closed properly.
        notes: what is not as it was when the recording was made (versions, machine, back end).
    """

    ticks: int
    differing: int
    first: ReplayedTick | None
    worst: ReplayedTick | None
    backend: str
    complete: bool
    notes: tuple[str, ...]

    @property
    def identical(self) -> bool:
        """No tick differs."""
        return self.differing == 0

    def __str__(self) -> str:
        if self.first is None or self.worst is None:
            return f"{self.ticks} ticks: every command is bit-identical"
        text = f"{self.differing} of {self.ticks} ticks differ; the first is {_said(self.first)}"
        return text if self.worst is self.first else f"{text}; the worst is {_said(self.worst)}"


def replay(
    recording: Recording | str | os.PathLike[str],
    stack: Stack | None = None,
    *,
    backend: str | None = None,
    trust: bool = False,
    progress: Callable[[int], None] | None = None,
) -> Replay:
    """Do the ticks of a recording again and compare every bit of their commands.

    Args:
        recording: the file, or what was read from it.
        stack: the declaration; default: the one in the recording.
        backend: default: that of the recording. Another gives the same commands only up to rounding.
        trust: see :func:`wbc.replaying.ticks.load_stack`.
        progress: called with the number of finished ticks after each.

    Raises:
        RecordingError: damaged, of another format, version, stack or layout.
        CommandError: an item of the stack that is given has no meaning for what was commanded.
        PicklingError: the stack in it cannot be read without ``trust``. CompileError: ``native`` without a compiler.
    """
    source = recording if isinstance(recording, Recording) else Recording(recording)
    if stack is not None:
        validation.instance("stack", stack, Declaration, "a wbc Stack")
    if progress is not None and not callable(progress):
        raise ShapeError("progress", progress, "expected a function of the number of ticks")
    controller = compiled(source, stack, backend=backend, trust=trust)
    count = differing = 0
    first = worst = None
    for tick in replayed(source, controller):
        count += 1
        if not tick.identical:
            differing += 1
            first = first or tick
            if worst is None or tick.difference > worst.difference:
                worst = tick
        if progress is not None:
            progress(count)
    return Replay(count, differing, first, worst, controller.backend, source.complete, _notes(source, controller))


def compiled(
    recording: Recording, stack: Stack | None = None, *, backend: str | None = None, trust: bool = False
) -> Controller:
    """A controller for the ticks of a recording; arguments and errors as of :func:`replay`."""
    from wbc import __version__

    given = recording.about
    if given["wbc"] != __version__:
        raise RecordingError("recording", given["wbc"], f"was made by another version of wbc, this is {__version__}")
    chosen = given["backend"] if backend is None else validation.one_of("backend", backend, BACKENDS)
    if stack is None:
        stack = _own_stack(recording, trust)
    elif stack.command == "velocity":
        stack = stack.commanding(given.get("command", stack.command))
    if declaration_key(stack) != given["declaration"]:
        items = [[e.name, type(e.item).__name__] for e in stack.entries]
        reason = f"is of another stack: {given['robot']} with {given['items']}, not {stack.robot.name} with {items}"
        raise RecordingError("recording", given["declaration"], reason)
    controller = stack.compile(solver=given["solver"], backend=chosen)
    conflict, chain = given["policy"]
    controller.policy = Policy(conflict, tuple(chain))
    names = recorded_inputs(core_of(controller).layout)
    sizes = {name: getattr(core_of(controller).tick, name).size for name in names}
    expected = {name: given["sizes"][name] for name in names}
    if sizes != expected:
        raise RecordingError("recording", expected, f"is of another layout, this version's is {sizes}")
    return controller


def replayed(recording: Recording, controller: Controller | None = None) -> Iterator[ReplayedTick]:
    """The ticks of a recording one by one, each with the whole step: ``print(tick.step)`` says what bound it.

    Args:
        controller: whose buffers are used, see :func:`compiled`; default: one of the stack in the recording.
    """
    controller = compiled(recording) if controller is None else controller
    again, parts, number = redoing(recording, controller), recording.parts, 0
    reset, v, flag = parts["reset"].start, parts["v"], parts["flag"].start
    for rows in recording.chunks():
        for row in rows:
            yield ReplayedTick(number, row[v].copy(), STATUSES[int(row[flag])], again(row, bool(row[reset])))
            number += 1


def redoing(recording: Recording, controller: Controller) -> Callable[[Array, bool], Step]:
    """What does a row of a recording again, from no active set or from that of the row before."""
    core = core_of(controller)
    buffers = [(getattr(core.tick, name), recording.parts[name]) for name in recorded_inputs(core.layout)]

    def again(row: Array, cold: bool) -> Step:
        for buffer, part in buffers:
            buffer[:] = row[part]
        if cold:
            core.tick.reset()
        return core.again()

    return again


def _own_stack(recording: Recording, trust: bool) -> Stack:
    if recording.stack_pickle is None:
        problem = recording.about["not_pickled"]
        reason = (
            f"holds no stack, which could not be pickled ({problem}): give it" if problem else "ends before its stack"
        )
        raise RecordingError("recording", str(recording.path), reason)
    stack = load_stack(recording.stack_pickle, trust=trust)
    if not isinstance(stack, Stack):
        raise RecordingError("recording", type(stack).__name__, "holds no Stack that compiles")
    return stack


def _notes(recording: Recording, controller: Controller) -> tuple[str, ...]:
    then, now = recording.about, about(controller)
    pairs = {name: (then["versions"][name], now["versions"][name]) for name in now["versions"]}
    pairs |= {name: (then[name], now[name]) for name in ("backend", "machine")}
    return tuple(f"{name} was {a}, is {b}" for name, (a, b) in pairs.items() if a != b)


def _said(tick: ReplayedTick) -> str:
    text = f"tick {tick.number}, by {tick.difference:.3g}"
    return text if tick.step.status == tick.status else f"{text}, {tick.status} then, {tick.step.status} now"
