"""``wbc view``: a robot, or a run, in the browser."""

from __future__ import annotations

import os
import pathlib
import threading
import webbrowser
from typing import Annotated

import typer
from rich.markup import escape

from wbc import extras, robots, validation
from wbc.cli import viewing
from wbc.cli.console import err, out
from wbc.errors import UnknownNameError, nearest
from wbc.record.recording import Recording
from wbc.robot import Robot
from wbc.viewer import run
from wbc.viewer.beside import token_for
from wbc.viewer.errors import ViewerError
from wbc.viewer.presets import of_robot
from wbc.viewer.runs import REPLAY, recording_in, save_page, states_of
from wbc.viewer.session import Session


def view(
    what: Annotated[
        str, typer.Argument(help="A name of `wbc robots`, a URDF or MJCF file, a run folder, or a recording.")
    ],
    export: Annotated[
        pathlib.Path | None, typer.Option(help="Of a run: write one HTML file that plays offline, and end.")
    ] = None,
    trust: Annotated[
        bool, typer.Option("--trust", help="Run code from the recording: items and functions that are not wbc's.")
    ] = False,
    host: viewing.Host = "127.0.0.1",
    port: viewing.Port = 0,
    browser: viewing.Browser = True,
    seconds: viewing.Seconds = None,
) -> None:
    """Show a robot with its joints on sliders, or a run with its time on one."""
    extras.require("viewer", "a page in the browser")
    path = pathlib.Path(what)
    if not validation.exists("what", what) and (path.name != what or path.suffix):
        raise ViewerError("what", what, validation.no_such(what, "there is no such file or folder"))
    recording = recording_in(path) if path.is_dir() or path.suffix == ".npz" else None
    if path.is_dir() and recording is None:
        page = path / REPLAY
        if not page.is_file():
            raise ViewerError("run", what, f"holds neither a recording nor {REPLAY}")
        viewing.say(page.resolve().as_uri())
        if browser:
            webbrowser.open(page.resolve().as_uri())
        return
    if recording is None:
        robot = _robot(what)
        if export is not None:
            raise ViewerError("export", what, "only runs are exported; this is a robot")
        chosen = of_robot(robot)
        err().print(escape(chosen.about), soft_wrap=True)
        with viewing.until_interrupted():
            controller = chosen.stack.compile(backend="vm")
            run(
                controller, chosen.start, seconds, host=host, port=port, open_browser=browser, announce=viewing.announce
            )
        return
    with err().status("doing the ticks of the recording again"):
        controller, states = states_of(Recording(recording), trust=trust)
    if export is not None:
        out().print(str(save_page(controller, states, export)), soft_wrap=True, markup=False)
        return
    session = Session(controller, None, states, host=host, port=port, token=token_for(host))
    viewing.say(session.url)
    if browser:
        webbrowser.open(session.url)
    if seconds is not None:
        threading.Timer(seconds, session.ended.set).start()
    with viewing.until_interrupted():
        session.run()


def _robot(what: str) -> Robot:
    """The robot of a name or a file; a name that is none may be that of something here."""
    try:
        return robots.load(what)
    except UnknownNameError as error:
        if error.field != "robot":
            raise
        near = nearest(what, [*error.choices, *os.listdir()])
        reason = f"no robot has this name, and there is no such file or folder; did you mean {near[0]!r}?"
        raise ViewerError("what", what, reason, near) from None
