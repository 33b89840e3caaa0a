"""The application: its commands, and what happens to errors.

A command's module is imported when the command is used; help and completion need only the table below.
"""

from __future__ import annotations

import functools
import importlib
import pathlib
import sys
from typing import Annotated, Any, NamedTuple

import typer
from typer.core import TyperCommand, TyperGroup

from wbc import __version__
from wbc.errors import WbcError

#: Exit codes besides 0 and 1, which commands give
BAD_INPUT, INTERRUPTED = 2, 130


class Listed(NamedTuple):
    """A command: module of this package and function, its line in the list of commands, settings of its parser, and
    whether it works in a clone of the repository alone.
    """

    module: str
    function: str
    line: str
    settings: dict[str, bool] | None = None
    in_clone: bool = False


COMMANDS = {
    "robots": Listed("robot.robots", "table", "List the robots that load by name."),
    "robot": Listed(
        "robot.robots", "show", "Show a robot: joints, limits, frames, shapes and where the numbers come from."
    ),
    "track": Listed("track", "track", "Follow a timed Cartesian path, and leave a log, plots and a summary."),
    "demo": Listed(
        "demo",
        "demo",
        "Do the main job: a Panda follows a timed path round an obstacle with its elbow plane commanded.",
    ),
    "moving-target": Listed(
        "moving_target",
        "moving_target",
        "Work on an object that moves, with and without compensation, and leave figures, plots and a film.",
    ),
    "play": Listed(
        "play", "play", "Open a robot in the browser: drag its targets and the obstacles, and read what holds it back."
    ),
    "view": Listed("view", "view", "Show a robot with its joints on sliders, or a run with its time on one."),
    "walk": Listed(
        "walking.walk",
        "walk",
        "Walk on a structure of holds with three arms, or end over end, and leave log, "
        "plan, check, pictures and a page.",
    ),
    "check": Listed(
        "walking.walk",
        "check",
        "Check the walk in a run's folder; exit code 4 if it violates anything.",
    ),
    "plans": Listed(
        "walking.walk", "plans", "Show what two plans do differently, one line each; exit code 1 if there is anything."
    ),
    "replay": Listed("replay", "replay", "Do the ticks of a recording again and compare every bit of their commands."),
    "export": Listed(
        "export",
        "export",
        "Write one control cycle of a robot, QP solver included, as C99 with a header, build files and a check.",
    ),
    "ik": Listed(
        "ik.ik",
        "ik",
        "Find joint positions that put a frame at a pose or a position, clear of obstacles and within the limits.",
    ),
    "ikor": Listed(
        "ikor",
        "ikor",
        "Run the published driver of redundant arms: its own trajectories, "
        "printed norms beside, or one from its files.",
    ),
    "relative-motion": Listed(
        "relative_motion",
        "relative_motion",
        "Compensation of relative motion as published: its straight lines, or another part of its system.",
    ),
    "compare-controllers": Listed(
        "compare_controllers",
        "compare_controllers",
        "Controllers of torques beside each other, on the published arm or on any robot.",
    ),
    "identify": Listed("identify", "identify", "Find the inertias of a simulated robot from a motion that shows much."),
    "explore": Listed(
        "explore",
        "explore",
        "Show all rates that serve a frame, the self-motion of the arm there, and its best configuration.",
    ),
    "analyse": Listed(
        "analysis.analyse",
        "analyse_",
        "Say where task and constraint coordinates lose rank, and whether they always suffice.",
    ),
    "advise": Listed(
        "analysis.advise",
        "advise",
        "Say which pairs are well conditioned at a configuration, where the next locus is, and which pair to use.",
    ),
    "modes": Listed(
        "analysis.modes",
        "modes",
        "Say in which modes arms can be commanded: how many pairs, or what is missing; of one robot, which pairs.",
    ),
    "drive": Listed(
        "drive",
        "drive",
        "Drive an arm by rates: the pair of coordinates that is chosen, at most six "
        "rates at a time, 50 times a second.",
    ),
    "study": Listed(
        "study",
        "study",
        "Many trials of a scenario, over parameters and seeds, on this machine or a cluster.",
    ),
    "bench": Listed(
        "bench",
        "bench",
        "Compare with pink, mink and placo on the same problems (needs the repository).",
        {"allow_extra_args": True, "ignore_unknown_options": True},
        in_clone=True,
    ),
    "docs": Listed(
        "docs",
        "docs",
        "Write what the code declares into the pages of tasks and constraints (needs the repository).",
        in_clone=True,
    ),
}


@functools.cache
def command(name: str) -> Any:
    """A command with its options."""
    entry = COMMANDS[name]
    function = getattr(importlib.import_module(f"wbc.cli.{entry.module}"), entry.function)
    single = typer.Typer(add_completion=False, rich_markup_mode="rich")
    single.command(name, context_settings=entry.settings)(function)
    made = typer.main.get_command(single)
    if not any("--json" in option.opts for option in made.params) and not entry.in_clone:
        made.params += [option for option in typer.main.get_command(_with_json).params if "--json" in option.opts]
    return made


def _wants_data(wanted: bool) -> None:
    if wanted:
        from wbc.cli import results

        results.collect()


#: Its option is added to commands that print lines and tables
_with_json = typer.Typer(add_completion=False)


@_with_json.command()
def _printed(
    as_json: Annotated[
        bool,
        typer.Option("--json", callback=_wants_data, expose_value=False, help="Print lines and tables as JSON."),
    ] = False,
) -> None:
    """Nothing: only its option is used."""


class CommandGroup(TyperGroup):
    """The commands of the table; an error of this package becomes one line and exit code 2."""

    def __init__(self, **settings: Any) -> None:
        super().__init__(**settings)
        clone = (pathlib.Path(__file__).resolve().parents[2] / "bench" / "__main__.py").is_file()
        for name, entry in COMMANDS.items():
            hidden = entry.in_clone and not clone
            self.add_command(TyperCommand(name, help=entry.line, rich_markup_mode="rich", hidden=hidden))

    def resolve_command(self, ctx: Any, args: list[str]) -> Any:
        """The command that was asked for, imported."""
        name, found, rest = super().resolve_command(ctx, args)
        return name, found and command(str(name)), rest

    def invoke(self, ctx: Any) -> Any:
        """Run the chosen command."""
        try:
            return self._run(ctx)
        except WbcError as error:
            from wbc.cli.console import complain

            complain(error)
            raise typer.Exit(BAD_INPUT) from error
        except KeyboardInterrupt:
            # While the command starts: one that has begun says what is left of its run
            raise typer.Exit(INTERRUPTED) from None

    def _run(self, ctx: Any) -> Any:
        try:
            return super().invoke(ctx)
        finally:
            if (results := sys.modules.get("wbc.cli.results")) is not None:
                from wbc.cli.console import print_json

                for found in results.taken():
                    print_json(found)


app = typer.Typer(
    name="wbc",
    cls=CommandGroup,
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
