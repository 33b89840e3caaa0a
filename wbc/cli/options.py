"""The options of ``wbc track`` and ``wbc demo``: their types and help."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from wbc.cli import completion
from wbc.track.presets import PRESETS

_SCENE, _CONTROL, _OUTPUT = "What it does", "How it is controlled", "What it writes"

RobotName = Annotated[
    str, typer.Argument(help="A name of `wbc robots`, or a URDF or MJCF file.", autocompletion=completion.robots)
]
PathName = Annotated[
    str,
    typer.Option(
        help=f"Preset ({', '.join(PRESETS)}) or a CSV, JSON or TOML file of waypoints.", rich_help_panel=_SCENE
    ),
]
FrameName = Annotated[
    str | None,
    typer.Option(
        help="Frame that follows the path. Default: the robot's tip.",
        rich_help_panel=_SCENE,
        autocompletion=completion.frames,
    ),
]
Duration = Annotated[
    float | None,
    typer.Option(help="Seconds. Default: 6, or the file's own; a file is stretched.", rich_help_panel=_SCENE),
]
Size = Annotated[
    float | None, typer.Option(help="Size of a preset, in m, see the documentation.", rich_help_panel=_SCENE)
]
Spheres = Annotated[
    list[str] | None,
    typer.Option(help="Obstacle X,Y,Z,RADIUS[,VX,VY,VZ] in m and m/s; may be repeated.", rich_help_panel=_SCENE),
]
Floor = Annotated[
    float | None, typer.Option(help="Height of a floor that links stay above, in m.", rich_help_panel=_SCENE)
]
Start = Annotated[
    str | None, typer.Option(help="First configuration, numbers with commas. Default: neutral.", rich_help_panel=_SCENE)
]
Plane = Annotated[
    str,
    typer.Option(
        help="Elbow plane: off, hold, swing; auto holds it if more than six joints move.", rich_help_panel=_SCENE
    ),
]
SwingAmplitude = Annotated[float, typer.Option(help="Amplitude of --plane swing, in rad.", rich_help_panel=_SCENE)]
Holds = Annotated[
    list[str] | None,
    typer.Option(help="Frame that must not move; default: feet of a floating robot.", rich_help_panel=_SCENE),
]
Rate = Annotated[float, typer.Option(help="Ticks a second, in Hz.", rich_help_panel=_CONTROL)]
Solver = Annotated[str, typer.Option(help="QP solver.", rich_help_panel=_CONTROL)]
PlantName = Annotated[
    str,
    typer.Option(
        "--plant",
        help="kinematic, or a robot on a fixed base with drives that give torques: pinocchio or mujoco.",
        rich_help_panel=_CONTROL,
    ),
]
Backend = Annotated[str, typer.Option(help="auto, native, vm or python.", rich_help_panel=_CONTROL)]
Gain = Annotated[float, typer.Option(help="Gain of the hand, in 1/s.", rich_help_panel=_CONTROL)]
Kind = Annotated[str, typer.Option(help="What follows the path: pose or position.", rich_help_panel=_CONTROL)]
Margin = Annotated[float, typer.Option(help="Distance kept from obstacles, in m.", rich_help_panel=_CONTROL)]
RunFolder = Annotated[
    Path | None,
    typer.Option("--out", "--output", help="Run folder. Default: runs/ROBOT-PATH-TIME.", rich_help_panel=_OUTPUT),
]
Force = Annotated[bool, typer.Option(help="Write into a folder that has a run.", rich_help_panel=_OUTPUT)]
LogFormat = Annotated[str, typer.Option(help="parquet or npz.", rich_help_panel=_OUTPUT)]
Record = Annotated[
    bool, typer.Option(help="Record the inputs of every tick, for `wbc replay`.", rich_help_panel=_OUTPUT)
]
AsJson = Annotated[bool, typer.Option("--json", help="Print the results as JSON.", rich_help_panel=_OUTPUT)]
Plots = Annotated[
    bool, typer.Option(help="Draw the plots, the picture and the page that plays the run.", rich_help_panel=_OUTPUT)
]
