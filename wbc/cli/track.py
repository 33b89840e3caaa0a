"""``wbc track``: one robot, one path, one folder of results."""

from __future__ import annotations

from wbc.cli import options
from wbc.cli.planning import given_obstacles, planned
from wbc.cli.session import Output, perform

#: Period of torques, about [s]
TORQUES = 0.001


def track(
    robot: options.RobotName = "panda",
    path: options.PathName = "circle",
    frame: options.FrameName = None,
    duration: options.Duration = None,
    size: options.Size = None,
    sphere: options.Spheres = None,
    floor: options.Floor = None,
    start: options.Start = None,
    plane: options.Plane = "auto",
    swing: options.SwingAmplitude = 0.5,
    hold: options.Holds = None,
    rate: options.Rate = 200.0,
    plant: options.PlantName = "kinematic",
    solver: options.Solver = "daqp",
    backend: options.Backend = "auto",
    kind: options.Kind = "pose",
    gain: options.Gain = 10.0,
    margin: options.Margin = 0.02,
    output: options.RunFolder = None,
    force: options.Force = False,
    log: options.LogFormat = "parquet",
    record: options.Record = True,
    plots: options.Plots = True,
) -> None:
    """Follow a timed Cartesian path, and leave a log, plots and a summary.

    Ctrl-C ends the run early; what was done until then is written all the same.
    """
    from wbc.simulation import driven

    plan = planned(
        robot,
        frame,
        start,
        hold,
        given_obstacles(sphere, floor),
        follow=(path, duration, size),
        plane=(plane, swing),
        rate=rate,
        margin=margin,
        gain=gain,
        kind=kind,
        solver=solver,
        backend=backend,
    )
    period = plan.dt / max(round(plan.dt / TORQUES), 1)
    perform(plan, Output(output, force, log, plots, record), driven(plant, plan.robot, period))
