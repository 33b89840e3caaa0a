"""Recording what a controller is given and commands, tick by tick."""

from __future__ import annotations

import atexit
import contextlib
import ctypes
import functools
import hashlib
import json
import logging
import os
import pickle
import platform
import struct
from typing import Any

import numpy as np

from wbc import extras, validation
from wbc.controller.compiled_stack import CompiledStack, core_of
from wbc.log.file import Columns, FileWriter
from wbc.record.background import BackgroundWriter
from wbc.record.recording import FORMAT, RecordingError
from wbc.record.rows import RowWriting, TickRow
from wbc.sealed import Sealed
from wbc.stack.declaration import Declaration
from wbc.stack.layout import Layout

log = logging.getLogger("wbc")

#: What a tick is a function of, besides the solver's memory of the last one; sensed inputs are in ``p``.
INPUTS = ("q", "v_last", "v_in", "use_v", "cap", "dt", "p", "weight", "enabled", "bound_enabled")


def recorded_inputs(layout: Layout) -> tuple[str, ...]:
    """What is recorded of every tick of a layout: accelerations also have the wrenches that were kept."""
    return INPUTS if layout.command == "velocity" else (*INPUTS, "kept")


#: Of the report, besides the command and how the tick ended: what is told of it, but not compared by a replay
TOLD = ("error", "margin")
#: The part ``reset`` of a tick that begins cold
COLD = struct.pack("d", 1.0)
#: The part ``reset`` of a tick that begins warm
WARM = struct.pack("d", 0.0)
#: Size of a chunk [bytes]: it is compared and written in some 50 us
CHUNK = 1 << 17
#: Ticks of a chunk at least: the first is written whole
FEWEST = 16
#: Time of a chunk's ticks at most, and of those that wait for the disk: what a kill loses is twice as long at most [s]
BEHIND = 1.0
#: Packages whose version decides the bits of a command
PACKAGES = ("casadi", "pin", "daqp", "osqp", "numpy")


class Recorder(Sealed):
    """Writes every tick of a controller into a file; made by :meth:`wbc.Controller.record`.

        with controller.record("run.npz") as recorder:
            ...                                             # step as usual
        print(recorder.count)

    The solver forgets its active set when a recording begins, as in a reset, so that a replay begins where the
    recording did. Where the file can no longer be written (disk full) the controller goes on without it, one line in
    the log says so, and :meth:`close` raises.

    Attributes:
        path: the file.
    """

    def __init__(self, controller: CompiledStack, path: str | os.PathLike[str], overwrite: bool) -> None:
        self.path = validation.file_path("path", path)
        self._core = core = core_of(controller)
        self._tick = core.tick
        layout, places = core.layout, core.context.memory
        row, state = TickRow(), core.tick.state.data.cast("B")
        given = row.add({name: places[name] for name in recorded_inputs(layout)})
        p = Columns.of(row.sizes)["p"]
        self._values = 8 * p.start, 8 * p.stop, state[8 * places["p"].start : 8 * places["p"].stop]
        reset, row.sizes["reset"] = row.size, 1
        others = {"others": slice(layout.nv, layout.variables)} if layout.variables > layout.nv else {}
        told = row.add({"v": slice(0, layout.nv)} | others | {name: places[name] for name in ("flag", *TOLD)})
        self._given, self._told = (
            [(begin, begin + size, state[place : place + size]) for begin, place, size in pieces]
            for pieces in (given, told)
        )
        pickled, problem = _pickled(controller.stack)
        text = about(controller) | {"sizes": row.sizes, "not_pickled": problem}
        ticks = min(max(FEWEST, CHUNK // row.size), max(1, round(BEHIND / controller.stack.dt)))
        waiting = max(1, round(BEHIND / (ticks * controller.stack.dt)))
        file = FileWriter(self.path, overwrite, RecordingError)
        self._writer: BackgroundWriter | None = BackgroundWriter(file, ticks * row.size, waiting)
        self._chunk, self._process = ticks, os.getpid()
        self._pieces = np.array([*given, *told], np.int64)
        self._writing = RowWriting(row=row.size, size=ticks * row.size, given=len(given), told=len(told), reset=reset)
        self._writing.pieces = self._pieces.ctypes.data
        self._fill(self._writer.begin(text, {} if pickled is None else {"stack.pickle": pickled}))
        #: resets of the controller before the last tick that was recorded whole
        self._seen = 0
        self._problem: OSError | None = None
        self._call, self._plain_call, self._finished = core.call, core.plain_call, core.finished
        core.call = functools.partial(_recorded, self)
        if self._call is self._plain_call:
            core.plain_call, core.finished = core.call, self._finish
            core.assembly.recording[0] = ctypes.addressof(self._writing)
        core.recording = self.path
        atexit.register(self._leave)

    @property
    def count(self) -> int:
        """Ticks so far. Refused inputs are no tick."""
        return self._writing.count

    def _fill(self, chunk: memoryview) -> None:
        """Record into this memory from now on."""
        self._memory, self._writing.chunk = chunk, ctypes.addressof(ctypes.c_char.from_buffer(chunk))
        self._writing.end = 0

    def close(self) -> None:
        """End the recording; what is not written yet is written. More calls do nothing.

        Raises:
            RecordingError: the file could not be written.
        """
        atexit.unregister(self._leave)
        self.flush()
        if self._writer is not None:
            try:
                self._writer.close()
            except OSError as error:
                self._fail(self._writer, error)
            self._detach()
        problem, self._problem = self._problem, None
        if problem is not None:
            reason = f"the recording ends after {self.count} ticks: {problem.strerror}"
            raise RecordingError("path", str(self.path), reason) from problem

    def flush(self) -> None:
        """Write the ticks that are only in memory, and wait until they are written."""
        self._send()
        if self._writer is not None:
            try:
                self._writer.wait()
            except OSError as error:
                self._fail(self._writer, error)

    def _send(self) -> None:
        """Have the ticks written that are only in memory."""
        if self._writer is None:
            return
        if self._process != os.getpid():
            # a fork has a copy of the controller, but the file is its parent's
            self._writer.abandon()
            self._detach()
        elif self._writing.end:
            try:
                self._fill(self._writer.exchange(self._memory, self._writing.end))
            except OSError as error:
                self._fail(self._writer, error)

    def _leave(self) -> None:
        """At the end of a process that did not close; what could not be written is in the log already."""
        with contextlib.suppress(RecordingError):
            self.close()

    def _fail(self, writer: BackgroundWriter, error: OSError) -> None:
        self._problem, self._writing.count = error, writer.written // self._writing.row
        log.warning("the recording %s ends after %d ticks: %s", self.path, self.count, error.strerror)
        writer.abandon()
        self._detach()

    def _detach(self) -> None:
        self._writer = None
        self._core.call, self._core.plain_call, self._core.finished = self._call, self._plain_call, self._finished
        self._core.assembly.recording[0], self._core.recording = 0, None

    def __enter__(self) -> Recorder:
        return self

    def __exit__(self, *exception: object) -> None:
        self.close()

    def _finish(self) -> None:
        """Record what came of a tick that C has begun to record: with nothing new, after the last one."""
        self._complete(True, self._seen)

    def _complete(self, ready: bool, resets: int) -> None:
        """Record what came of a tick that began ``ready`` and after so many ``resets`` of the controller."""
        if self._core.resets != resets:
            # found again from other rows, which are sensed inputs, and from no active set
            first, last, numbers = self._values
            self._memory[self._writing.end + first : self._writing.end + last] = numbers
        self._tell(ready and self._core.resets == self._seen)

    def _tell(self, warm: bool) -> None:
        """Record what came of a tick; ``warm``: the solver remembered what it was recorded with."""
        memory, writing = self._memory, self._writing
        begin = writing.end
        first = begin + writing.reset
        memory[first : first + len(COLD)] = WARM if warm else COLD
        for first, last, numbers in self._told:
            memory[begin + first : begin + last] = numbers
        writing.end = begin + writing.row
        writing.count += 1
        writing.ready, self._seen = 1, self._core.resets
        if writing.end == writing.size:
            self._send()


def _recorded(recorder: Recorder) -> int:
    """A tick, recorded; those of which nothing but the configuration and values is new C records by itself."""
    writing, core = recorder._writing, recorder._core
    if writing.end == writing.size:
        # Ctrl-C came while the last chunk was waiting for the disk
        recorder._send()
    ready, resets = writing.ready, core.resets
    if not ready:
        # the first one, or the one before was interrupted between its call and its record
        recorder._tick.reset()
    memory, begin = recorder._memory, writing.end
    for first, last, numbers in recorder._given:
        memory[begin + first : begin + last] = numbers
    writing.ready = 0
    flag = recorder._call()
    if flag:
        flag = core.finish(flag)
    if flag < 0:
        writing.ready = ready
        return flag
    recorder._complete(bool(ready), resets)
    return flag


def record(controller: CompiledStack, path: str | os.PathLike[str], overwrite: bool) -> Recorder:
    """See :meth:`wbc.Controller.record`."""
    if (other := core_of(controller).recording) is not None:
        raise RecordingError("path", str(path), f"the controller records into {other} already")
    return Recorder(controller, path, validation.flag("overwrite", overwrite))


def about(controller: CompiledStack) -> dict[str, Any]:
    """What a recording says about its controller, besides the sizes of a tick's parts."""
    from wbc import __version__

    return {
        "format": FORMAT,
        "wbc": __version__,
        "robot": controller.stack.robot.name,
        "declaration": declaration_key(controller.stack),
        "items": [[e.name, type(e.item).__name__] for e in controller.stack.entries],
        "dt": controller.stack.dt,
        "solver": controller.solver,
        "backend": controller.backend,
        "policy": [controller.policy.conflict, list(controller.policy.chain)],
        "versions": extras.versions(PACKAGES),
        "machine": f"{platform.system()} {platform.machine()}",
        "command": controller.stack.command,
        "names": names(controller),
    }


def names(controller: CompiledStack) -> dict[str, Any]:
    """What the numbers of a tick are: [name, unit] of each coordinate, command and other variable; [item, row, unit] of
    each residual and margin; [item, input, first, end, unit] of each input, which are places in ``p``.
    """
    layout, robot = core_of(controller).layout, controller.stack.robot
    model, units = robot.model, robot.dof_units
    coordinates = list[list[str]]()
    for name, size, first in zip(model.names[1:], model.nqs[1:], model.idx_vs[1:], strict=True):
        single = [[name, units[first]]]
        coordinates += single if size == 1 else [[f"{name}.{k}", ""] for k in range(size)]
    each = "/s" if layout.command == "velocity" else "/s^2"
    return {
        "q": coordinates,
        "v": [[name, unit + each] for name, unit in zip(robot.dof_names, units, strict=True)],
        "others": [layout.variable(k) for k in range(layout.nv, layout.variables)],
        "error": [[b.entry.name, row.label, row.unit] for b in layout.of_form("task") for row in b.rows],
        "margin": [[b.entry.name, row.label, row.unit] for b in layout.of_form("margins") for row in b.rows],
        "inputs": [
            [name, slot.input.name, slot.span.start, slot.span.stop, slot.input.unit]
            for name, block in layout.blocks.items()
            for slot in block.slots.values()
        ],
    }


def declaration_key(stack: Declaration) -> str:
    """Hash of what the compiled code is declared by, whatever code compiles it."""
    return hashlib.sha256(json.dumps(stack.key_data(), sort_keys=True).encode()).hexdigest()[:32]


def _pickled(stack: Declaration) -> tuple[bytes | None, str]:
    """The stack's pickle, or None and why there is none."""
    try:
        return pickle.dumps(stack, protocol=4), ""
    except (pickle.PicklingError, AttributeError, TypeError) as error:
        return None, str(error)
