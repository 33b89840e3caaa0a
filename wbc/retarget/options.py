"""Options of retargeting."""

from __future__ import annotations

from dataclasses import dataclass, field

from wbc import validation

#: Least and most of the numbers among the options, in their units
BOUNDS = {
    "rate": (1.0, 2000.0), "tick_rate": (10.0, 2000.0), "scale": (1e-3, 1e3), "clearance": (0.0, 1.0),
    "balance": (0.0, 1e6),
    **dict.fromkeys(("acceleration", "velocity", "base_velocity", "base_acceleration"), (1e-3, 1e6)),
}  # fmt: skip


@dataclass(frozen=True)
class RetargetWeights:
    """Weights of the tasks against each other: of a metre and a radian."""

    #: position and turn of the pelvis
    pelvis: float = 60.0
    turn: float = 2.0
    #: turn of the chest, and of the head
    chest: float = 2.0
    head: float = 0.5
    #: knees and elbows
    middle: float = 2.0
    #: wrists, and centres of hands
    wrist: float = 8.0
    #: feet in the air: position and turn
    foot: float = 1000.0
    sole: float = 30.0
    #: joints towards ``robot.neutral``
    posture: float = 1e-3

    def __post_init__(self) -> None:
        for name in self.__dataclass_fields__:
            object.__setattr__(self, name, validation.scalar(f"weights.{name}", getattr(self, name), low=0.0))


@dataclass(frozen=True)
class RetargetOptions:
    """How a clip is retargeted.

    Attributes:
        rate: frames a second of the motion [Hz]; None: the clip's.
        tick_rate: ticks a second at least [Hz]; a frame is so many ticks.
        scale: metres of the robot to one of the clip; None: of the lengths of legs.
        acceleration: limit of the joints of which the robot's description has none [rad/s^2].
        velocity: the same of velocity [rad/s].
        base_velocity, base_acceleration: of a floating base: linear [m/s], [m/s^2], and in rad as many.
        clearance: links keep this distance from each other [m]; None: not asked for.
        all_fours: hands and feet of a person lead four legs; None: where the clip's hands are on the ground.
        balance: the centre of mass is drawn over the contacts, with this weight; 0: it is not.
        hold: feet that stand are hard rows.
        weights: of the tasks.
    """

    rate: float | None = None
    tick_rate: float = 50.0
    scale: float | None = None
    acceleration: float = 480.0
    velocity: float = 20.0
    base_velocity: float = 20.0
    base_acceleration: float = 5000.0
    clearance: float | None = None
    all_fours: bool | None = None
    balance: float = 0.0
    hold: bool = True
    weights: RetargetWeights = field(default_factory=RetargetWeights)

    def __post_init__(self) -> None:
        for name, (low, high) in BOUNDS.items():
            if (value := getattr(self, name)) is not None or name not in ("rate", "scale", "clearance"):
                object.__setattr__(self, name, validation.scalar(f"options.{name}", value, low=low, high=high))
        validation.flag("options.hold", self.hold)
        if self.all_fours is not None:
            validation.flag("options.all_fours", self.all_fours)
        validation.instance("options.weights", self.weights, RetargetWeights, "a RetargetWeights")
