"""The application: its commands, and what happens to errors.

A command's module is imported when the command is used; help and completion need only the table below.
"""

from __future__ import annotations

import functools
import importlib
import itertools
import pathlib
import sys
from collections.abc import Iterable, Mapping
from typing import Annotated, Any, NamedTuple

import typer
from typer.core import TyperCommand, TyperGroup

from wbc import __version__
from wbc.errors import UnknownNameError, WbcError

#: Exit code after bad input
BAD_INPUT = 2
#: Exit code after Ctrl-C
INTERRUPTED = 130
#: Where the context keeps the words of the command
WORDS = "words"


class Listed(NamedTuple):
    """A command.

    Attributes:
        line: in the list of commands.
        modes: name -> module of this package and class in it; the first is that of a command without a name of one, and
            the only one has no name.
        in_clone: it works in a clone of the repository alone.
    """

    line: str
    modes: Mapping[str, str]
    in_clone: bool = False


COMMANDS = {
    "robots": Listed(
        "Robots by name: all, one, or links that must not touch.",
        {"list": "robots.Names", "show": "robots.RobotShow", "pairs": "robots.RobotPairs"},
    ),
    "ik": Listed(
        "Find joint positions for poses; explore all that serve one.",
        {"solve": "ik.Solve", "explore": "explore.Explore"},
    ),
    "track": Listed(
        "Follow a timed path; leave a log, plots and a summary.", {"path": "track.Track", "demo": "track.Demo"}
    ),
    "walk": Listed(
        "Walk and climb with any limbs on any scene.",
        {
            "path": "walk.WalkPath",
            "drive": "walk.DriveWalk",
            "limb": "walk.WalkLimb",
            "resume": "walk.Resume",
            "check": "walk.CheckWalk",
            "compare": "walk.Compare",
            "published": "walk.Published",
        },
    ),
    "plan": Listed("Find a path to a pose or configuration, clear of obstacles.", {"": "plan.PlanPath"}),
    "retarget": Listed("Clips of people and animals onto robots.", {"": "retarget.RetargetClips"}),
    "view": Listed(
        "See and drive robots, and see runs, in the browser.",
        {"show": "view.ViewShow", "play": "view.Play", "pairs": "view.ViewPairs", "walk": "view.ViewWalk"},
    ),
    "coordinates": Listed(
        "Pairs of coordinates: modes, advice, loci, driving.",
        {
            "modes": "coordinates.modes.Modes",
            "advise": "coordinates.advise.Advise",
            "survey": "coordinates.advise.Survey",
            "restrictions": "coordinates.advise.Restrictions",
            "analyse": "coordinates.analyse.Analyse",
            "drive": "coordinates.drive.DriveArm",
        },
    ),
    "moving-target": Listed("Work on an object that moves, compensated or not.", {"": "moving_target.MovingTarget"}),
    "dynamics": Listed(
        "Compare controllers, size motors, identify inertias.",
        {"controllers": "dynamics.Controllers", "motors": "dynamics.SizedMotors", "identify": "dynamics.Identify"},
    ),
    "published": Listed(
        "Published methods: redundant arms, relative motion.",
        {
            "ikor": "published.ikor.Cases",
            "ikor-run": "published.ikor.RunFiles",
            "ikor-space": "published.ikor.Space",
            "relative-motion": "published.relative_motion.RelativeMotion",
        },
    ),
    "study": Listed("Do many trials of a scenario, here or on a cluster.", {"": "study.Trials"}),
    "export": Listed("Write one control cycle, QP solver included, as C99.", {"": "export.Export"}),
    "replay": Listed("Do the ticks of a recording again, bit for bit.", {"": "replay.ReplayRun"}),
    "convert": Listed("Write runs as MCAP, CSV, npz, for Rerun or LeRobot.", {"": "convert.ConvertRun"}),
    "docs": Listed("Write pages from what the code declares (in a clone).", {"": "docs.Docs"}, in_clone=True),
}


def options_class(name: str, mode: str) -> Any:
    """The dataclass of a mode, imported."""
    module, _, options = COMMANDS[name].modes[mode].rpartition(".")
    return getattr(importlib.import_module(f"wbc.cli.{module}"), options)


@functools.cache
def command(name: str, mode: str = "") -> Any:
    """A command with the options of one of its modes, "" for the first."""
    from wbc.cli.reading import parser

    entry = COMMANDS[name]
    first = next(iter(entry.modes))
    mode = mode or first
    made = parser(f"{name} {mode}".strip(), options_class(name, mode), as_json=not entry.in_clone)
    if mode and mode == first:
        lines = (f"wbc {name} {one}: {options_class(name, one).__doc__.splitlines()[0]}" for one in entry.modes)
        made.epilog = "\n\n".join(["Modes, each with a --help of its own:", *lines])
        _complete_modes(made, entry.modes)
    return made


def _complete_modes(made: Any, modes: Iterable[str]) -> None:
    """The shell completes the names of modes in the place of the first argument."""
    asked = next((param for param in made.params if param.param_type_name == "argument"), made)
    before = asked.shell_complete
    # The click that typer brings, or the one that is installed beside it
    click = importlib.import_module(TyperCommand.__mro__[1].__module__.replace(".core", ".shell_completion"))

    def completed(ctx: Any, incomplete: str) -> list[Any]:
        names = [click.CompletionItem(name) for name in modes if name.startswith(incomplete)]
        return [*names, *before(ctx, incomplete)]

    asked.shell_complete = completed


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
        ctx.meta[WORDS] = list(args)
        given, found, rest = super().resolve_command(ctx, args)
        if not found:
            return given, found, rest
        name = str(given)
        modes = COMMANDS[name].modes
        mode = rest.pop(0) if rest and rest[0] in modes else ""
        chosen = command(name, mode)
        # More words than the first mode takes: the first of them was to be a mode
        most = sum(param.param_type_name == "argument" for param in chosen.params)
        words = [*itertools.takewhile(lambda word: not word.startswith("-"), rest)]
        if len(words) > most and len(modes) > 1 and not mode and not ctx.resilient_parsing:
            raise UnknownNameError("mode", rest[0], modes)
        return f"{name} {mode}".strip(), chosen, rest

    def invoke(self, ctx: Any) -> Any:
        try:
            return self._run(ctx)
        except WbcError as error:
            from wbc.cli.console import complain
            from wbc.cli.refused import of_its_option, taken_elsewhere

            words = ctx.meta.get(WORDS, ())
            complain(of_its_option(error, words), taken_elsewhere(error, words))
            raise typer.Exit(BAD_INPUT) from error
        except KeyboardInterrupt:
            # While the command starts: one that has begun says what is left of its run
            raise typer.Exit(INTERRUPTED) from None

    def _run(self, ctx: Any) -> Any:
        try:
            return super().invoke(ctx)
        finally:
            if (console := sys.modules.get("wbc.cli.console")) is not None:
                console.print_kept()


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
    """Whole-body control: declarative tasks, one QP, one native tick."""
