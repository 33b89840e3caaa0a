"""``wbc dynamics``: controllers of torques beside each other, and inertias from a motion."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from wbc.cli.reading import Option
from wbc.cli.scene import Force, RobotName

if TYPE_CHECKING:
    from rich.table import Table

    from wbc.motion_control.comparison import ComparisonRow, ControlScenario, TrialCondition


@dataclass(frozen=True)
class Controllers:
    """Compare controllers of torques, on the published arm or any.

    Without a robot: the published three-link arm on its line of 0.58 m in 1 s. With one: all its joints swing for 2 s.
    The published controllers need a fixed base. Without --payload, --heavier, --noise and --rate: as modelled, with
    half the mass of the last link, or a tenth of the robot's, at the tip, with links 1.2 times heavier, with noise of
    1e-5; each at 100 Hz and at 1 kHz. See docs/motion_control.md.

    Example: wbc dynamics controllers ur5 --payload 3 --rate 1000
    """

    robot: Annotated[
        str | None, Option("A name of `wbc robots`, or a file. Default: the published arm.", placed=True)
    ] = None
    base: Annotated[Literal["fixed", "floating"] | None, "Base of the robot. Default: that of the table."] = None
    plant: Annotated[Literal["pinocchio", "mujoco"], "What simulates."] = "pinocchio"
    payload: Annotated[float | None, "Mass at the tip that no controller knows of [kg]."] = None
    heavier: Annotated[float | None, "How many times heavier links are than controllers think [1]."] = None
    noise: Annotated[float | None, "Standard deviation of measured joints [rad, m]."] = None
    rate: Annotated[float | None, "Commands a second [Hz]."] = None
    gravity: Annotated[float | None, "Gravity downwards [m/s^2]. Default: the robot's."] = None
    only: Annotated[tuple[str, ...], "One controller by name; may be repeated."] = ()
    out: Annotated[Path | None, "Folder for plots and figures. Default: runs/controllers-TIME."] = None
    force: Force = False

    def run(self) -> None:
        from wbc.cli.console import out, progress_bar, say, write_json
        from wbc.cli.folders import filled, run_folder
        from wbc.motion_control.comparison import TrialCondition, compare, save_plot, standard_conditions
        from wbc.motion_control.trial import loaded

        scenario = self._scenario()
        given = {name: getattr(self, name) for name in ("payload", "heavier", "noise", "rate")}
        chosen = {name: value for name, value in given.items() if value is not None}
        conditions: Sequence[TrialCondition] = (
            (TrialCondition(**chosen),) if chosen else standard_conditions(scenario.payload)
        )
        for condition in conditions:
            loaded(scenario.robot, condition.payload, condition.heavier, scenario.frame)
        names = scenario.names(self.only)
        written = ("controllers.json", "controllers-*.png")
        folder = run_folder(self.out, "controllers", written, self.force, clear=False)
        found: list[ComparisonRow] = []
        total = sum(len(names) * scenario.seconds * condition.rate for condition in conditions)
        say(f"{scenario.robot.name}, {scenario.seconds:g} s, {self.plant}")
        say("tip, in mm: largest distance from its place, and over the last tenth; largest torque in N m or N; us:")
        say("a command in Python; payload: as learned, and the least standard deviation that the motion allows")
        with progress_bar() as bar:
            task = bar.add_task("controllers", total=total)
            for k, condition in enumerate(conditions, start=1):
                runs, interrupted = [], False
                try:
                    for one in compare(scenario, condition, names, plant=self.plant, tick=lambda: bar.advance(task)):
                        runs.append(one)
                except KeyboardInterrupt:
                    interrupted = True
                    if not runs and not found:
                        raise
                found += runs
                if runs:
                    out().print(_table(runs, str(condition)))
                    # What is done is kept, whatever comes after
                    with filled(folder, written if k == 1 else ()) as fresh:
                        save_plot(runs, f"{scenario.robot.name}: {condition}", fresh / f"controllers-{k}.png")
                        told = {
                            "robot": scenario.robot.name,
                            "plant": self.plant,
                            "rows": [one.data() for one in found],
                        }
                        write_json(fresh / "controllers.json", told)
                if interrupted:
                    say(f"ended after {len(found)} of {len(names) * len(conditions)} runs")
                    break
        say(folder)

    def _scenario(self) -> ControlScenario:
        import numpy as np

        from wbc import robots, validation
        from wbc.published.newton_euler.comparison import published_scenario, scenario_with_published

        if self.robot is None:
            return published_scenario()
        machine = robots.load(self.robot, base=self.base)
        if self.gravity is not None:
            model = machine.model.copy()
            model.gravity.linear = np.array([0.0, 0.0, -validation.scalar("gravity", self.gravity, unit="m/s^2")])
            machine = replace(machine, model=model)
        return scenario_with_published(machine)


@dataclass(frozen=True)
class SizedMotors:
    """Say the largest load and speed of a motion that motors allow.

    Of a motion of all joints of a robot on a fixed base, under limits of torque and voltage, with back-EMF. See
    docs/motion_control.md.

    Example: wbc dynamics motors ur5 --motor 1,48,0.05,0.4,100,3e-5 --payload 2
    """

    robot: RobotName = "ur5"
    motor: Annotated[
        tuple[str, ...],
        "[JOINT=]TORQUE,VOLTAGE,CONSTANT,RESISTANCE[,GEAR[,INERTIA[,FRICTION]]] in N m, V, N m/A, ohm, -, kg m^2, "
        "N m s; without a joint: of all others. May be repeated.",
    ] = ()
    payload: Annotated[float, "Load at the tip while the speed is looked for [kg]."] = 0.0
    speed: Annotated[float, "Times the motion's own speed while the load is looked for [1]."] = 1.0
    seconds: Annotated[float, "Duration of the motion [s]."] = 2.0

    def run(self) -> None:
        from wbc import robots
        from wbc.cli.console import say
        from wbc.motion_control import ActuatorSizing, read_actuators
        from wbc.motion_control.comparison import swing

        machine = robots.load(self.robot)
        motion = swing(machine, self.seconds)
        sizing = ActuatorSizing(machine, motion, self.seconds, read_actuators(machine, self.motor))
        for bound, what, unit in (
            (sizing.largest_load(self.speed), f"load at {self.speed:g} times the speed", "kg"),
            (sizing.largest_speed(self.payload), f"speed with {self.payload:g} kg", "times its own"),
        ):
            binds = f": {bound.row} of {bound.joint} at {bound.time:.3g} s" if bound.joint else ": nothing binds"
            say(f"largest {what}: {bound.value:.4g} {unit}{binds}")


@dataclass(frozen=True)
class Identify:
    """Find the inertias of a simulated robot from a motion.

    From one that shows much of them. See docs/identification.md.

    Example: wbc dynamics identify ur5 --far 0.3
    """

    robot: RobotName = "ur5"
    far: Annotated[float, "How far the true bodies are from the model's: deviation of logarithms [1]."] = 0.2
    noise: Annotated[float, "Standard deviation of the encoders [rad, m]."] = 1e-5
    tries: Annotated[int, "Motions that are looked at for the one that shows most."] = 200
    seed: Annotated[int, "Of the search, of the true bodies and of all noise."] = 0
    out: Annotated[Path | None, "Folder for law, plot and figures. Default: runs/identify-TIME."] = None
    force: Force = False

    def run(self) -> None:
        from wbc import robots
        from wbc.cli.console import out, progress_bar, say, table, write_json
        from wbc.cli.folders import filled, run_folder
        from wbc.identification.experiment import experiment
        from wbc.trajectory import plot

        machine = robots.load(self.robot)
        written = ("identified.json", "motion.png", "motion.npz")
        folder = run_folder(self.out, "identify", written, self.force, clear=False)
        with progress_bar() as bar:
            task = bar.add_task("motions", total=self.tries + 1)
            done = experiment(
                machine,
                far=self.far,
                noise=self.noise,
                tries=self.tries,
                seed=self.seed,
                tick=lambda: bar.advance(task),
            )
        motion, found = done.motion, done.found
        parameters = f"{found.base.count} of {len(found.parameters)} parameters can be known"
        say(f"{parameters}; a motion of {motion.law.duration:.1f} s")
        say(f"log det of its information {motion.score:.1f}, of the first random motions {motion.first:.1f} at best")
        say(f"its limits: {motion.law.certificate}")
        columns = [done.check[1], done.check[0], *found.friction()]
        rows = ((name, *(f"{c[dof]:.3g}" for c in columns)) for dof, name in enumerate(machine.dof_names))
        out().print(table(("torques not explained", "by the model", "by the fit", "viscous", "Coulomb"), rows))
        say(f"on a motion that the fit has not seen; base parameters are {done.deviations:.2f} standard deviations off")
        with filled(folder, written) as fresh:
            write_json(fresh / "identified.json", done.data())
            motion.law.save(fresh / "motion.npz")
            plot(motion.law, fresh / "motion.png")
        say(folder)


def _table(runs: Sequence[ComparisonRow], title: str) -> Table:
    from wbc.cli.console import table

    rows = []
    for one in runs:
        most = f"{abs(one.trial.torques).max():.3g}" if len(one.trial.torques) else ""
        off = ["ran away", ""] if one.trial.away else [f"{1e3 * one.largest:.3g}", f"{1e3 * one.residual:.3g}"]
        rows.append((one.name, *off, most, f"{one.microseconds:.0f}", one.learned))
    return table(("controller", "largest", "at the end", "torque", "us", "payload"), rows, title)
