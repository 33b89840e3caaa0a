"""Controllers beside each other on one motion, under loads, heavier links and noise that none of them knows of."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path

import numpy as np

from wbc import style, validation
from wbc.errors import UnsupportedJointError
from wbc.motion_control.adaptive import AdaptiveControl
from wbc.motion_control.computed_torque import ComputedTorque
from wbc.motion_control.impedance import Impedance
from wbc.motion_control.motion import Motion, TorqueController
from wbc.motion_control.perturbation import OneStepPerturbation
from wbc.motion_control.stack_tracking import StackTracking
from wbc.motion_control.trial import Trial, loaded, make_plant, run_trial
from wbc.multibody import pin
from wbc.robot import Robot
from wbc.validation import Array

Maker = Callable[[Robot, Motion, float], TorqueController]
#: Both poles of a controller are at this, or at half a radian a step where that is lower [1/s]
FASTEST = 100.0
#: Part of a robot's mass that its unknown payload has
PAYLOAD = 0.1
#: Factor by which links are heavier than the controller believes
HEAVIER = 1.2
#: Standard deviation of the encoders' noise [rad, m]
NOISE = 1e-5
#: Part of the joints' ranges that :func:`swing` uses
RANGE = 0.35
#: Part of the limits of speed that :func:`swing` uses
SPEED = 0.4
#: Half the range that :func:`swing` gives unbounded joints [rad, m]
FREE = 1.0
#: Factor by which amplitudes shrink where a joint has not the effort
SMALLER = 0.7
#: Part of the effort above which holding still leaves too little, so that smaller amplitudes do not help
SPARE = 0.9


def poles(dt: float) -> float:
    """w of a step [s]: FASTEST, or 0.5 / dt where that is less."""
    return min(FASTEST, 0.5 / dt)


#: Name -> controller of a robot, a motion and a step [s]
CONTROLLERS: Mapping[str, Maker] = {
    "computed torque": lambda robot, motion, dt: ComputedTorque(
        robot, motion, dt, stiffness=poles(dt) ** 2, damping=2.0 * poles(dt)
    ),
    "adaptive, last link": lambda robot, motion, dt: AdaptiveControl(
        robot, motion, dt, stiffness=poles(dt), damping=poles(dt)
    ),
    "adaptive, all links": lambda robot, motion, dt: AdaptiveControl(
        robot, motion, dt, stiffness=poles(dt), damping=poles(dt), learn=robot.joint_names[robot.base_nv > 0 :]
    ),
    "impedance": lambda robot, motion, dt: Impedance(robot, motion, dt, frequency=poles(dt)),
    "one-step optimum": OneStepPerturbation,
    "torque stack": lambda robot, motion, dt: StackTracking(
        robot, motion, dt, stiffness=poles(dt) ** 2, damping=2.0 * poles(dt)
    ),
}
#: Those that a floating base without motors can have
FLOATING = ("computed torque", "adaptive, last link", "adaptive, all links", "torque stack")


@dataclass(frozen=True)
class TrialCondition:
    """What a controller does not know, and how often it is asked.

    Attributes:
        payload: at the tip [kg]. heavier: how many times links are. noise: of encoders, standard deviation [rad, m].
        rate: commands a second [Hz].
    """

    payload: float = 0.0
    heavier: float = 1.0
    noise: float = 0.0
    rate: float = 100.0

    def __post_init__(self) -> None:
        validation.scalar("rate", self.rate, low=10.0, high=1e4, unit="Hz")
        validation.scalar("noise", self.noise, low=0.0, high=0.1)

    def __str__(self) -> str:
        said = [f"{self.payload:g} kg"] * (self.payload > 0.0) + [f"links x {self.heavier:g}"] * (self.heavier != 1.0)
        said += [f"noise {self.noise:g}"] * (self.noise > 0.0)
        return f"{', '.join(said) or 'as modelled'}, {self.rate:g} Hz"


@dataclass(frozen=True, eq=False)
class ControlScenario:
    """What is compared.

    Attributes:
        robot: that all controllers believe in. motion: that they follow. seconds: for so long.
        controllers: name -> controller. payload: that is usual to add [kg]. frame: whose distance is told.
    """

    robot: Robot
    motion: Motion
    seconds: float
    controllers: Mapping[str, Maker]
    payload: float
    frame: str | None = None
    floating: Sequence[str] = field(default=FLOATING)

    def names(self, only: Sequence[str] = ()) -> tuple[str, ...]:
        """Of the controllers that this robot can have, or of those that are chosen.

        Raises:
            UnknownNameError: no such controller. UnsupportedJointError: one that needs a fixed base.
        """
        possible = [n for n in self.controllers if self.robot.base == "fixed" or n in self.floating]
        for name in only:
            if validation.one_of("controller", name, self.controllers) not in possible:
                raise UnsupportedJointError("controller", name, "it needs a robot on a fixed base")
        return tuple(only) or tuple(possible)


@dataclass(frozen=True, eq=False)
class ComparisonRow:
    """One controller under one condition.

    Attributes:
        name: of the controller. trial: what happened. microseconds: of one command, the median, in Python.
        mass: of the payload, as it was learned of the last link, and the standard deviation that the motion allows at
            best [kg].
    """

    name: str
    condition: TrialCondition
    trial: Trial
    microseconds: float
    mass: tuple[float, float] | None

    @property
    def largest(self) -> float:
        """Largest distance of the tip [m]; infinite where the robot ran away."""
        return float("inf") if self.trial.away else float(self.trial.tip.max())

    @property
    def residual(self) -> float:
        """Root of the mean square of the distance over the last tenth [m]; infinite where the robot ran away."""
        last = self.trial.tip[-max(1, len(self.trial.tip) // 10) :]
        return float("inf") if self.trial.away else float(np.sqrt((last**2).mean()))

    @property
    def learned(self) -> str:
        """What is claimed of the payload: nothing that the motion does not show to a tenth, or to 50 g."""
        if self.mass is None:
            return ""
        value, deviation = self.mass
        shown = 2.0 * deviation <= max(0.1 * abs(value), 0.05)
        return f"{value:.4g} kg +- {deviation:.1g}" if shown else "not shown by this motion"

    def data(self) -> dict[str, object]:
        """Numbers for a file; what is not finite is left out."""
        row: dict[str, object] = {"name": self.name, **asdict(self.condition), "ran_away": self.trial.away}
        row["microseconds"] = self.microseconds
        if not self.trial.away:
            row |= {"tip_mm": 1e3 * self.largest, "end_mm": 1e3 * self.residual}
            row["torques"] = abs(self.trial.torques).max(axis=0).tolist()
        if self.mass is not None:
            value, deviation = self.mass
            row |= {"payload_kg": value, "deviation_kg": deviation if deviation < float("inf") else None}
        return row


def compare(
    scenario: ControlScenario,
    condition: TrialCondition,
    only: Sequence[str] = (),
    *,
    plant: str = "pinocchio",
    tick: Callable[[], None] = lambda: None,
) -> Iterator[ComparisonRow]:
    """The controllers one by one.

    Raises:
        UnknownNameError: no such controller or plant. RangeError: a payload out of range, or a step that does not
            divide the time.
    """
    names, dt = scenario.names(only), 1.0 / condition.rate
    true = loaded(scenario.robot, condition.payload, condition.heavier, scenario.frame)
    simulated = make_plant(plant, true, dt)
    for name in names:
        law = scenario.controllers[name](scenario.robot, scenario.motion, dt)
        trial = run_trial(
            simulated, scenario.robot, law, scenario.motion, dt, scenario.seconds,
            frame=scenario.frame, noise=condition.noise, tick=tick,
        )  # fmt: skip
        learned = law.mass(law.learn[-1]) if isinstance(law, AdaptiveControl) else None
        spent = 1e6 * float(np.median(trial.seconds)) if len(trial.seconds) else float("inf")
        yield ComparisonRow(name, condition, trial, spent, learned)


def swing(robot: Robot, seconds: float, seed: int = 0) -> Motion:
    """A motion of all joints that begins and ends at rest, within their limits:

        q_i(t) = middle_i + a_i b(t) sin(w_i t + p_i),   b(t) = sin^2(pi t / seconds)

    It goes on at rest. The middle is the robot's neutral configuration, moved into the range; on a fixed base
    amplitudes are as small as limits of effort need.
    """
    limits, base = robot.limits, robot.base_nv
    random, n = np.random.default_rng(seed), robot.nv - base
    lower, upper, speed = (x[base:] for x in (limits.position_lower, limits.position_upper, limits.velocity))
    span = np.where(np.isfinite(upper - lower), upper - lower, 2.0 * FREE)
    places = robot.position_index[base:]
    now = np.where(places >= 0, robot.neutral[np.maximum(places, 0)], 0.0)
    amplitude = np.minimum(RANGE * span, FREE) * random.uniform(0.6, 1.0, n)
    low, high = (np.where(np.isfinite(x), x, 0.0) for x in (lower + amplitude, upper - amplitude))
    bounded = np.isfinite(upper - lower) & (places >= 0)
    shift = np.where(bounded, np.clip(now, np.minimum(low, high), np.maximum(low, high)) - now, 0.0)
    pulse = np.pi / seconds
    w = 2.0 * np.pi / seconds * random.uniform(1.0, 2.5, n)
    # |dq/dt| <= a (w + pi / seconds)
    amplitude = np.minimum(amplitude, SPEED * np.where(np.isfinite(speed), speed, 4.0) / (w + pulse))
    phase = random.uniform(0.0, 2.0 * np.pi, n)
    middle = robot.integrate(robot.neutral, np.concatenate([np.zeros(base), shift]))

    def motion(t: float) -> tuple[Array, Array, Array]:
        t = min(max(t, 0.0), seconds)
        b = (np.sin(pulse * t) ** 2, pulse * np.sin(2 * pulse * t), 2 * pulse**2 * np.cos(2 * pulse * t))
        s = (np.sin(w * t + phase), w * np.cos(w * t + phase), -(w**2) * np.sin(w * t + phase))
        still = np.zeros(base)
        x, dx = amplitude * b[0] * s[0], amplitude * (b[1] * s[0] + b[0] * s[1])
        ddx = amplitude * (b[2] * s[0] + 2 * b[1] * s[1] + b[0] * s[2])
        if t in (0.0, seconds):
            dx, ddx = 0.0 * dx, 0.0 * ddx
        q = pin.integrate(robot.model, middle, np.concatenate([still, x]))
        return np.asarray(q), np.concatenate([still, dx]), np.concatenate([still, ddx])

    while not base and _overloads(robot, motion, seconds):
        amplitude *= SMALLER
    return motion


def _overloads(robot: Robot, motion: Motion, seconds: float) -> bool:
    """Whether a joint needs more than its effort for a motion, that could stand still there with some to spare."""
    model, data, still, limit = robot.model, robot.model.createData(), np.zeros(robot.nv), robot.limits.effort
    for t in np.linspace(0.0, seconds, 41):
        q, v, a = motion(t)
        needed, held = (np.abs(pin.rnea(model, data, q, *rates)) for rates in ((v, a), (still, still)))
        if ((needed > limit) & (held < SPARE * limit)).any():
            return True
    return False


def scenario_of(robot: Robot, seconds: float = 2.0) -> ControlScenario:
    """A swing of any robot on a fixed or floating base, with the controllers of this package."""
    mass = float(f"{PAYLOAD * sum(body.mass for body in robot.model.inertias):.2g}")
    return ControlScenario(robot, swing(robot, seconds), seconds, CONTROLLERS, mass)


def standard_conditions(payload: float) -> tuple[TrialCondition, ...]:
    """As modelled, with a payload [kg], with heavier links, with noise; each at 100 Hz and at 1 kHz."""
    kinds = TrialCondition(), TrialCondition(payload), TrialCondition(heavier=HEAVIER), TrialCondition(noise=NOISE)
    return tuple(replace(kind, rate=rate) for kind in kinds for rate in (100.0, 1000.0))


def save_plot(found: Sequence[ComparisonRow], title: str, path: Path) -> None:
    """Distances of the tip, and torques of the three joints that need the largest, over time."""
    runs = [one for one in found if len(one.trial.torques)]
    largest = np.array([np.abs(one.trial.torques).max(axis=0) for one in runs])
    # A controller that chatters is not to hide the others
    sizes = np.median(largest, axis=0)
    joints = np.sort(np.argsort(sizes)[-3:])
    with style.pyplot() as plt:
        size = (9, 4 + 2 * len(joints))
        figure, axes = plt.subplots(1 + len(joints), 1, figsize=size, sharex=True, layout="constrained")
        for k, one in enumerate(runs):
            trial, away = one.trial, " (ran away)" if one.trial.away else ""
            look = {"color": style.CYCLE[k % len(style.CYCLE)], "linestyle": "-" if k < len(style.CYCLE) else "--"}
            axes[0].semilogy(trial.times[1:], 1e3 * np.maximum(trial.tip[1:], 1e-9), label=one.name + away, **look)
            for axis, joint in zip(axes[1:], joints, strict=True):
                axis.step(trial.times[: len(trial.torques)], trial.torques[:, joint], where="post", **look)
        axes[0].set(title=title, ylabel="tip off [mm]", ylim=(1e-4, None))
        for axis, joint in zip(axes[1:], joints, strict=True):
            most = 2.0 * max(float(sizes[joint]), 1e-3)
            axis.set(ylabel=f"tau {joint + 1} [N m or N]", ylim=(-most, most))
        axes[-1].set(xlabel="time [s]")
        figure.legend(loc="outside lower center", ncols=3)
        figure.savefig(path)
        plt.close(figure)
