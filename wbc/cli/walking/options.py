"""The options of ``wbc walk``: their types and help."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

#: Names and defaults as :mod:`wbc.walking` has them, which help does without
BUILT_IN = ("cylinder", "plane", "truss", "module")
SPEED, TURN_RATE = 0.1016, 0.05

_SCENE, _HOW, _OUTPUT = "What it does", "How it is done", "What it writes"

RobotName = Annotated[
    str, typer.Option("--robot", help="three-armed, or two-ended: end over end, --gait.", rich_help_panel=_SCENE)
]
Arms = Annotated[
    int,
    typer.Option(help="Arms of the body, 2 to 6; with more than three it is larger.", rich_help_panel=_SCENE),
]
Gait = Annotated[str, typer.Option(help="Of the two-ended arm: inchworm, turnaround or any.", rich_help_panel=_SCENE)]
StructureName = Annotated[
    str,
    typer.Option(
        help=f"{', '.join(BUILT_IN)}, grapples, or FILE.csv. Default: cylinder; of the two-ended arm grapples.",
        show_default=False,
        rich_help_panel=_SCENE,
    ),
]
Mode = Annotated[
    str,
    typer.Option(
        help="velocity: least delay, then fewest re-grasps; destination: fewest re-grasps; arm: one hand, --do.",
        rich_help_panel=_SCENE,
    ),
]
Speed = Annotated[
    float, typer.Option(help="Largest of the body's origin in the structure's frame, in m/s.", rich_help_panel=_SCENE)
]
TurnRate = Annotated[float, typer.Option(help="Largest rate of turning, in rad/s.", rich_help_panel=_SCENE)]
From = Annotated[
    str,
    typer.Option(
        "--from",
        help="Place that the body begins over: T,A or T,A,DEGREES on the cylinder, else a hold's id; "
        "of the two-ended arm its two holds, 'ID1 ID2'.",
        rich_help_panel=_SCENE,
    ),
]
To = Annotated[
    list[str] | None,
    typer.Option(
        help="Place that it goes to; may be repeated. Of the two-ended arm one hold, or x,y,z of its elbow.",
        rich_help_panel=_SCENE,
    ),
]
RemoveRows = Annotated[str, typer.Option(help="Take away holds T,A by A, such as 12-14.", rich_help_panel=_SCENE)]
RemoveColumns = Annotated[str, typer.Option(help="Take away holds T,A by T.", rich_help_panel=_SCENE)]
Remove = Annotated[float, typer.Option(help="Take away this part of the holds at random.", rich_help_panel=_SCENE)]
Seed = Annotated[int, typer.Option(help="Of the random choice.", rich_help_panel=_SCENE)]
Rigid = Annotated[bool, typer.Option(help="Holds fix the tilt of a hand.", rich_help_panel=_SCENE)]
PlannerName = Annotated[str, typer.Option(help="free or published.", rich_help_panel=_HOW)]
PlanFile = Annotated[
    str, typer.Option("--plan", help="Carry out a plan.json as it is, instead of planning.", rich_help_panel=_HOW)
]
Change = Annotated[
    list[str] | None,
    typer.Option("--set", help="NAME=VALUE of the walker's data, in SI; may be repeated.", rich_help_panel=_HOW),
]
Backend = Annotated[str, typer.Option(help="auto, native or vm.", rich_help_panel=_HOW)]
PlantName = Annotated[
    str,
    typer.Option(
        "--plant",
        help="kinematic, or under torques: pinocchio (rigid grips), mujoco (soft ones); these need holds that fix the "
        "tilt of a hand, --rigid.",
        rich_help_panel=_HOW,
    ),
]
Gravity = Annotated[
    str, typer.Option(help="x,y,z in m/s^2 along the structure's axes; of plants with torques.", rich_help_panel=_HOW)
]
Faults = Annotated[
    list[str] | None,
    typer.Option(
        "--fault",
        help="'slip ARM METRES at SECONDS', 'limp JOINT at SECONDS', 'break ARM at SECONDS' or 'delay SECONDS'; may be "
        "repeated.",
        rich_help_panel=_HOW,
    ),
]
LeastTime = Annotated[
    bool,
    typer.Option("--least-time", help="Least time of the plan's joint path, by toppra.", rich_help_panel=_OUTPUT),
]
RunFolder = Annotated[
    Path | None, typer.Option("--out", help="Run folder. Default: runs/walk-STRUCTURE-TIME.", rich_help_panel=_OUTPUT)
]
Force = Annotated[bool, typer.Option(help="Write into a folder that has a run.", rich_help_panel=_OUTPUT)]
Check = Annotated[bool, typer.Option(help="Run the external checker.", rich_help_panel=_OUTPUT)]
Strict = Annotated[bool, typer.Option("--strict", help="Old: a violation ends with 4 anyway.", hidden=True)]
Pictures = Annotated[
    bool, typer.Option(help="Draw plots, stills, animation and the replay page.", rich_help_panel=_OUTPUT)
]
Commands = Annotated[
    str,
    typer.Option(
        help="Drive the body by rates: FILE (CSV or npz: t, T, A, spin) or keyboard; mode velocity.",
        rich_help_panel=_SCENE,
    ),
]
ArmName = Annotated[str, typer.Option("--arm", help="The arm of arm mode. Default: the first.", rich_help_panel=_SCENE)]
Do = Annotated[
    list[str] | None,
    typer.Option(
        "--do",
        help="Arm mode: 'hold ID', 'poses FILE' or 'rate vx,vy,vz,wx,wy,wz for SECONDS'; may be repeated.",
        rich_help_panel=_SCENE,
    ),
]
FreeStart = Annotated[
    bool, typer.Option("--free-start", help="Begin with nothing held, the body fixed.", rich_help_panel=_SCENE)
]
Ask = Annotated[
    bool,
    typer.Option(
        "--ask",
        help="Propose every re-grasp: a line of input is empty for yes, or another hold; at its end the walk stops.",
        rich_help_panel=_HOW,
    ),
]
Resume = Annotated[
    str,
    typer.Option(
        help="Go on with a run, ended or killed: its folder, or FOLDER@SECONDS. It keeps structure, robot and rates.",
        rich_help_panel=_SCENE,
    ),
]
