"""The application: its commands, and what happens to errors."""

from __future__ import annotations

from typing import Annotated, Any

import typer
from typer.core import TyperGroup

from wbc import __version__
from wbc.cli import (
    advise,
    analyse,
    bench,
    demo,
    docs,
    drive,
    explore,
    export,
    ik,
    ikor,
    modes,
    replay,
    robots,
    track,
    walk,
)
from wbc.cli.console import complain
from wbc.errors import WbcError

#: Exit codes besides 0 and 1, which commands give
BAD_INPUT, INTERRUPTED = 2, 130


class Commands(TyperGroup):
    """Commands whose errors of this package become one line and exit code 2."""

    def invoke(self, ctx: Any) -> Any:
        """Run the chosen command."""
        try:
            return super().invoke(ctx)
        except WbcError as error:
            complain(error)
            raise typer.Exit(BAD_INPUT) from error


app = typer.Typer(
    name="wbc",
    cls=Commands,
    no_args_is_help=True,
    rich_markup_mode="rich",
    context_settings={"help_option_names": ["-h", "--help"]},
    pretty_exceptions_enable=False,
)


def _version(wanted: bool) -> None:
    if wanted:
        typer.echo(f"wbc {__version__}")
        raise typer.Exit


@app.callback()
def wbc(
    version: Annotated[bool, typer.Option("--version", callback=_version, is_eager=True, help="Print it.")] = False,
) -> None:
    """Whole-body control: declarative tasks, one QP, one native tick.

    [bold]wbc walk[/bold] has a three-armed robot walk on a structure of holds, [bold]wbc demo[/bold] a Panda follow a
    timed path round an obstacle.
    """


app.command("robots")(robots.table)
app.command("robot")(robots.show)
app.command("track")(track.track)
app.command("demo")(demo.demo)
app.command("walk")(walk.walk)
app.command("plans")(walk.plans)
app.command("replay")(replay.replay)
app.command("export")(export.export)
app.command("ik")(ik.ik)
app.command("ikor")(ikor.ikor)
app.command("explore")(explore.explore)
app.command("analyse")(analyse.analyse_)
app.command("advise")(advise.advise)
app.command("modes")(modes.modes)
app.command("drive")(drive.drive)
app.command("bench", context_settings={"allow_extra_args": True, "ignore_unknown_options": True})(bench.bench)
app.command("docs")(docs.docs)
