"""Recording what a controller is given and commands, tick by tick."""

from __future__ import annotations

import atexit
import contextlib
import functools
import hashlib
import json
import logging
import os
import pickle
import platform
import struct
from typing import Any

from wbc import extras, validation
from wbc.controller.compiled_stack import CompiledStack, core_of
from wbc.log.file import FileWriter, LogWriter
from wbc.record.recording import FORMAT, RecordingError
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
#: In place of a number of resets: what the solver remembers is not what was recorded
UNKNOWN = -1
#: The part ``reset`` of a tick that begins cold
COLD = struct.pack("d", 1.0)
#: The part ``reset`` of a tick that begins warm
WARM = struct.pack("d", 0.0)
#: Size of a chunk [bytes]: writing it takes a loop some 0.1 ms, and its memory is not asked of the system each time
CHUNK = 1 << 17
#: Ticks of a chunk at least
FEWEST = 16
#: Ticks of a chunk at most
MOST = 1024
#: Packages whose version decides the bits of a command
PACKAGES = ("casadi", "pin", "daqp", "osqp", "numpy")


class Recorder:
    """Writes every tick of a controller into a file; made by :meth:`wbc.Controller.record`.

        with controller.record("run.npz") as recorder:
            ...                                             # step as usual
        print(recorder.count)

    The solver forgets its active set when a recording begins, as in a reset, so that a replay begins where the
    recording did. Where the file can no longer be written (disk full) the controller goes on without it, one line in
    the log says so, and :meth:`close` raises.

    Attributes:
        path: the file.
        count: ticks so far. Refused inputs are no tick.
    """

    def __init__(self, controller: CompiledStack, path: str | os.PathLike[str], overwrite: bool) -> None:
        self.path = validation.file_path("path", path)
        self.count = 0
        self._core = core = core_of(controller)
        self._tick = core.tick
        views = {name: getattr(self._tick, name) for name in recorded_inputs(core.layout)}
        layout = core.layout
        sizes = {name: view.size for name, view in views.items()} | {"reset": 1, "v": layout.nv}
        if layout.variables > layout.nv:
            sizes["others"] = layout.variables - layout.nv
        sizes["flag"] = 1
        told = [self._tick.report[core.context.memory[name]] for name in TOLD]
        sizes |= {name: part.size for name, part in zip(TOLD, told, strict=True)}
        self._told = [part.data.cast("B") for part in told if part.size]
        self._given = [view.data.cast("B") for view in views.values() if view.size]
        begin = 8 * sum(views[name].size for name in INPUTS[: INPUTS.index("p")])
        self._values, self._place = views["p"].data.cast("B"), slice(begin, begin + 8 * views["p"].size)
        # the report begins with the command and the flag
        self._command = self._tick.report.data.cast("B")[: 8 * (layout.variables + 1)]
        pickled, problem = _pickled(controller.stack)
        text = about(controller) | {"sizes": sizes, "not_pickled": problem}
        self._writer: LogWriter | None = FileWriter(self.path, overwrite, RecordingError)
        self._writer.begin(text, {} if pickled is None else {"stack.pickle": pickled})
        self._size = 8 * sum(sizes.values())
        self._chunk, self._process = max(FEWEST, min(MOST, CHUNK // self._size)), os.getpid()
        # Ticks that are not written yet, in memory that is kept: what asks the system for more waits where it is short
        self._memory, self._end = memoryview(bytearray(self._chunk * self._size)), 0
        #: resets of the controller before the last tick that was recorded whole
        self._seen = UNKNOWN
        self._problem: OSError | None = None
        self._call = core.call
        core.call = functools.partial(_recorded, self)
        core.recording = self.path
        atexit.register(self._leave)

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
                self._fail(error)
            self._detach()
        problem, self._problem = self._problem, None
        if problem is not None:
            reason = f"the recording ends after {self.count} ticks: {problem.strerror}"
            raise RecordingError("path", str(self.path), reason) from problem

    def flush(self) -> None:
        """Write the ticks that are only in memory."""
        if self._writer is None:
            return
        if self._process != os.getpid():
            # a fork has a copy of the controller, but the file is its parent's
            self._writer.abandon()
            self._detach()
        elif self._end:
            try:
                self._writer.write(self._memory[: self._end])
            except OSError as error:
                self.count -= self._end // self._size
                self._fail(error)
                self._writer.abandon()
                self._detach()
            self._end = 0

    def _leave(self) -> None:
        """At the end of a process that did not close; what could not be written is in the log already."""
        with contextlib.suppress(RecordingError):
            self.close()

    def _fail(self, error: OSError) -> None:
        self._problem = error
        log.warning("the recording %s ends after %d ticks: %s", self.path, self.count, error.strerror)

    def _detach(self) -> None:
        self._writer = None
        self._core.call = self._call
        self._core.recording = None

    def __enter__(self) -> Recorder:
        return self

    def __exit__(self, *exception: object) -> None:
        self.close()


def _recorded(recorder: Recorder) -> int:
    """A tick, recorded."""
    resets, seen = recorder._core.resets, recorder._seen
    if seen == UNKNOWN:
        # the first one, or the one before was interrupted between its call and its record
        recorder._tick.reset()
    # joining bytes is several times as fast as copying as many numpy arrays
    given = b"".join(recorder._given)
    recorder._seen = UNKNOWN
    flag = recorder._call()
    if flag:
        flag = recorder._core.finish(flag)
    if flag < 0:
        recorder._seen = seen
        return flag
    if recorder._core.resets != resets:
        # found again from other rows, which are sensed inputs, and from no active set
        resets = recorder._core.resets
        given = b"".join((given[: recorder._place.start], recorder._values, given[recorder._place.stop :]))
    row = b"".join((given, WARM if resets == seen else COLD, recorder._command, *recorder._told))
    end = recorder._end + recorder._size
    recorder._memory[recorder._end : end] = row
    recorder._end = end
    recorder._seen = resets
    recorder.count += 1
    if end == len(recorder._memory):
        recorder.flush()
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
