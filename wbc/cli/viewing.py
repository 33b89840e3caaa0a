"""What ``wbc play`` and ``wbc view`` share: options, and what they say."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from typing import Annotated

import typer

from wbc.api import Controller, Stack
from wbc.cli.console import err, out
from wbc.viewer import Viewer

Host = Annotated[
    str, typer.Option(help="Address to listen on; one that other machines reach needs the token that is printed.")
]
Port = Annotated[int, typer.Option(help="0: any that is free.")]
Browser = Annotated[bool, typer.Option(help="Open the page in the browser.")]
Seconds = Annotated[float | None, typer.Option(help="End after so long; default: Ctrl-C.")]


def compiled(stack: Stack, backend: str) -> Controller:
    """The controller; compiling the first time is said."""
    with err().status(f"compiling the stack of {stack.robot.name}; it is kept for the next time"):
        return stack.compile(backend=backend)


def announce(viewer: Viewer) -> None:
    """Print the page's address."""
    say(viewer.url)


def say(url: str) -> None:
    """An address, plain, so that it can be read by a program."""
    out().print(url, soft_wrap=True, markup=False)


@contextlib.contextmanager
def until_interrupted() -> Iterator[None]:
    """Ctrl-C is how these commands end."""
    with contextlib.suppress(KeyboardInterrupt):
        yield
