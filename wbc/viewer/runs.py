"""Runs that were recorded: their ticks again, as states to look at and to export."""

from __future__ import annotations

import contextlib
import html
import io
import pathlib
import re
import zipfile
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from wbc import __version__, extras, validation
from wbc.api import Controller, Stack
from wbc.controller.step import state_of
from wbc.record.recording import Recording
from wbc.replaying.ticks import compiled, replayed
from wbc.robot import Robot
from wbc.stack.artifact import compile_stack
from wbc.tasks import EndEffector, Posture
from wbc.validation import Array
from wbc.viewer.drawing import Drawing, look
from wbc.viewer.errors import ViewerError
from wbc.viewer.link import SharedTick
from wbc.viewer.reading import sentences
from wbc.viewer.scenery import Scenery
from wbc.viewer.tick import Tick

#: The recording in a run's folder
RECORDING = "ticks.npz"
#: The page that a run exports
REPLAY = "replay.html"
#: States of a recording that are kept a second [1/s]
RATE = 40.0
#: States of a page that are kept a second [1/s]
PAGE_RATE = 20.0
#: States that a page has at most
PAGE_STATES = 1200
#: What is said of the holds of a scenery
Note = Mapping[str, Any]
#: Corners of a page's meshes closer than this part of the robot's characteristic length are one
PAGE_DETAIL = 0.012


def states_of(recording: Recording, *, trust: bool = False, rate: float = RATE) -> tuple[Controller, list[SharedTick]]:
    """The ticks of a recording done again: a controller of their stack, and ``rate`` states a second.

    Raises:
        RecordingError, PicklingError, CompileError: as of :func:`wbc.replay`.
    """
    controller = compiled(recording, backend="auto", trust=trust)
    dt, states, due = float(recording.about["dt"]), [], 0.0
    for tick in replayed(recording, controller):
        time = tick.number * dt
        if time >= due - 1e-9:
            states.append(SharedTick(tick.number + 1, time, state_of(tick.step)))
            due = time + 1.0 / rate
    if not states:
        raise ViewerError("recording", str(recording.path), "holds no tick")
    return controller, states


def sentences_of(recording: Recording, ticks: Sequence[int]) -> dict[int, str]:
    """Number of a tick of a recording -> why its command was what it was."""
    wanted, out = set(ticks), {}
    for tick in replayed(recording, compiled(recording, backend="auto")):
        if tick.number in wanted:
            out[tick.number] = " ".join(sentences(tick.step.explain()))
            if len(out) == len(wanted):
                break
    return out


def is_recording(file: pathlib.Path) -> bool:
    """Whether a file is a recording, of whatever version."""
    try:
        with zipfile.ZipFile(file) as archive:
            return "about.json" in archive.namelist()
    except zipfile.BadZipFile:
        # One whose writer was killed has no directory
        return True
    except OSError:
        return False


def recording_in(folder: pathlib.Path) -> pathlib.Path | None:
    """The recording of a run's folder, or the file itself; None where there is none."""
    found = folder / RECORDING if folder.is_dir() else folder
    # Something else may have this name
    return found if found.is_file() and is_recording(found) else None


def save_motion(
    robot: Robot,
    times: Sequence[float] | Array,
    places: Sequence[Array] | Array,
    file: pathlib.Path,
    *,
    scenery: Scenery | None = None,
    notes: Sequence[Note] = (),
) -> pathlib.Path:
    """Write a motion of any robot as :func:`save_page` does: configurations ``places`` at ``times`` [s].

    Args:
        scenery, notes: as of :func:`save_page`, a note for each time.

    Raises:
        ViewerError: as of :func:`save_page`. ShapeError, NotFiniteError, RotationError: no configurations.
    """
    stack = Stack(robot, dt=1.0 / PAGE_RATE)
    for name, frame in robot.frames.items():
        if name == "tip" or name.endswith("_hand"):
            stack.add(EndEffector(frame), name=name)
    stack.add(Posture(), name="posture")
    # Not by Stack.compile, which warns of what might move too fast: nothing is commanded here
    controller = Controller(stack, compile_stack(stack, "vm", __version__), "daqp")
    states, said, due = list[SharedTick](), list[Note](), -np.inf
    for k, (time, q) in enumerate(zip(times, places, strict=True)):
        if time >= due - 1e-9:
            said += notes[k : k + 1]
            # Its targets are where it is, so that nothing but the robot and the way of its hands is drawn
            controller.reset(q)
            states.append(SharedTick(len(states) + 1, float(time), state_of(controller.step(q))))
            due = time + 1.0 / PAGE_RATE
    return save_page(controller, states, file, scenery=scenery, notes=said)


def save_page(
    controller: Controller,
    states: Sequence[SharedTick],
    file: pathlib.Path,
    title: str = "",
    *,
    scenery: Scenery | None = None,
    notes: Sequence[Note] = (),
) -> pathlib.Path:
    """Write states as one HTML file that plays in a browser, without a network or this package.

    Args:
        scenery: what stands around. notes: what is said of its holds in each state, see :meth:`Drawing.note`.

    Raises:
        MissingPackageError: viser is not installed.
        ViewerError: there is nothing to write, or the file cannot be written.
    """
    extras.require("viewer", "a page in the browser")
    import viser

    if not states:
        raise ViewerError("states", 0, "there is nothing to show")
    validation.instance("controller", controller, Controller, "a wbc Controller")
    length = states[-1].time - states[0].time
    step = max(1.0 / PAGE_RATE, length / PAGE_STATES)
    # What is recorded is what a server would send; nobody is asked to connect, so its address is not printed
    with contextlib.redirect_stdout(io.StringIO()):
        server = viser.ViserServer(host="127.0.0.1", port=0, verbose=False)
        try:
            drawing = Drawing(server.scene, controller, detail=PAGE_DETAIL, scenery=scenery)
            first = Tick(controller, states[0])
            look(server, controller, first, scenery)
            serializer, before = None, states[0].time
            for k, state in enumerate(states):
                if k and state.time - before < step - 1e-9 and state is not states[-1]:
                    continue
                if serializer is not None:
                    serializer.insert_sleep(state.time - before)
                drawing.show(Tick(controller, state))
                if notes:
                    drawing.note(notes[k])
                serializer, before = serializer or server.get_scene_serializer(), state.time
            assert serializer is not None
            text = str(serializer.as_html())
            name = html.escape(title or f"{controller.stack.robot.name} – wbc replay")
            text = re.sub("<title>.*?</title>", lambda _: f"<title>{name}</title>", text, count=1)
        finally:
            server.stop()
    with validation.writing("file", file, ViewerError):
        file.write_text(text, encoding="utf-8")
    return file
