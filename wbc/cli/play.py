"""``wbc play``: a robot to be dragged in the browser."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Annotated

import typer
from rich.markup import escape

from wbc import extras
from wbc.cli import viewing
from wbc.cli.console import err
from wbc.cli.options import Backend
from wbc.viewer import run
from wbc.viewer.local import require_local
from wbc.viewer.presets import PRESETS, playground

#: Of the walker on its structure, which is more than a stack
CLIMB = "climb"
#: Nothing real moves, so slow machines may be silent for long [s]
SILENCE = 10.0


def play(
    preset: Annotated[str, typer.Argument(help=f"{', '.join(PRESETS)}, or {CLIMB}: the walker, steered.")] = "panda",
    host: viewing.Host = "127.0.0.1",
    port: viewing.Port = 0,
    browser: viewing.Browser = True,
    pairs: Annotated[
        bool, typer.Option("--pairs", help="Drive by coordinate pairs: ssrms, spdm, or any arm by name or file.")
    ] = False,
    zeromq: Annotated[
        str, typer.Option(help="Take messages over ZeroMQ as well, at an address such as tcp://127.0.0.1:5555.")
    ] = "",
    silence: Annotated[
        float,
        typer.Option(help="The robot stops where the page, or the viewer, gives no sign of life for so many seconds."),
    ] = SILENCE,
    seconds: viewing.Seconds = None,
    backend: Backend = "auto",
) -> None:
    """Open a robot in the browser: drag its targets and the obstacles, and read what holds it back."""
    extras.require("viewer", "a page in the browser")
    if zeromq:
        require_local(zeromq)
    begin: Callable[..., None]
    if preset == CLIMB:
        from wbc.viewer.climbing import climb

        _say("Steer with W S A D and Q E or the stick, or click a hold.")
        begin = partial(climb, backend=backend)
    elif pairs:
        from wbc.viewer.operating import operate

        _say("Choose a pair, and drive what it commands by its sliders.")
        begin = partial(operate, preset, backend=backend)
    else:
        chosen = playground(preset)
        _say(chosen.about)
        begin = partial(run, viewing.compiled(chosen.stack, backend), chosen.start)
    with viewing.until_interrupted():
        begin(
            seconds,
            host=host,
            port=port,
            open_browser=browser,
            zeromq=zeromq,
            silence=silence,
            announce=viewing.announce,
        )


def _say(about: str) -> None:
    err().print(f"{escape(about)} Space stops it, Ctrl-C ends.", soft_wrap=True)
