"""What a program says: steps with guards, as a schema that Python and YAML share; see :meth:`Program.read`."""

from __future__ import annotations

from dataclasses import fields
from pathlib import Path
from typing import Annotated, Any, Literal

import yaml
from pydantic import ConfigDict, Field, PositiveFloat, ValidationError, model_validator
from pydantic.dataclasses import dataclass, rebuild_dataclass

from wbc.errors import RobotFileError, WbcError, nearest
from wbc.multibody import pin

Three = tuple[float, float, float]


class ProgramError(WbcError):
    """A program that does not follow the schema: ``field`` says where, ``value`` what stands there."""


#: They do not change, and have no other fields than those declared
_STRICT = ConfigDict(extra="forbid", allow_inf_nan=False)


class _Explaining(type):
    """Makes one typed error of what the outermost part of a program finds wrong in itself and in its parts."""

    def __call__(cls, *positional: Any, **values: Any) -> Any:
        try:
            return super().__call__(*positional, **values)
        except ValidationError as error:
            raise _explained(cls, error) from None


class Declared(metaclass=_Explaining):
    """What all parts of a program have in common."""


@dataclass(frozen=True, config=_STRICT)
class Guard(Declared):
    """A signal on one side of a threshold for some time.

    Attributes:
        signal: a name among those given to :meth:`Runner.tick`, or ``elapsed``, the time [s] that the step has run.
        above, below: the threshold, in the signal's unit; exactly one of them.
        lasting: how long without a break the signal must be there [s].
    """

    signal: str
    above: float | None = None
    below: float | None = None
    lasting: float = Field(default=0.0, ge=0.0)

    @model_validator(mode="after")
    def _one_side(self) -> Guard:
        if (self.above is None) == (self.below is None):
            raise ValueError("expected either above or below")
        return self

    def holds(self, value: float) -> bool:
        """Whether a value is on that side; NaN is on neither."""
        return value > self.above if self.above is not None else value < (self.below or 0.0)

    def __str__(self) -> str:
        return f"{self.signal} {'above' if self.above is not None else 'below'} {self.above or self.below or 0.0:g}"


@dataclass(frozen=True, config=_STRICT)
class PoseTarget(Declared):
    """Where a hand is to be, in the reference frame of its task.

    Attributes:
        position: [m]; None: where it is. quaternion: x, y, z, w; None: as it is turned.
    """

    position: Three | None = None
    quaternion: tuple[float, float, float, float] | None = None

    @model_validator(mode="after")
    def _unit(self) -> PoseTarget:
        if self.quaternion is not None and abs(sum(x * x for x in self.quaternion) - 1.0) > 1e-6:
            raise ValueError("quaternion: expected x, y, z, w of length 1")
        return self

    def from_here(self, here: pin.SE3) -> pin.SE3:
        """The pose, with what is not said taken from another one."""
        out = here.copy()
        if self.position is not None:
            out.translation[:] = self.position
        if self.quaternion is not None:
            out.rotation = pin.Quaternion(*(self.quaternion[k] for k in (3, 0, 1, 2))).matrix()
        return out


@dataclass(frozen=True, config=_STRICT)
class ProgramStep(Declared):
    """What all steps have in common.

    Attributes:
        name: for the log; default: what it does. timeout: the step fails after this time [s].
        unless: the step fails when one of these guards holds.
    """

    name: str = Field(default="", kw_only=True)
    timeout: PositiveFloat | None = Field(default=None, kw_only=True)
    unless: tuple[Guard, ...] = Field(default=(), kw_only=True)


@dataclass(frozen=True, config=_STRICT)
class Move(ProgramStep):
    """A hand goes straight to a pose, and is there when its measured error is within the tolerance.

    Attributes:
        hand: name of an ``EndEffector`` of the stack. to: the pose. speed: largest speeds [m/s], [rad/s].
        within: largest distance [m] and angle [rad] at the end.
    """

    step: Literal["move"] = Field(default="move", kw_only=True)
    hand: str
    to: PoseTarget
    speed: tuple[PositiveFloat, PositiveFloat] = (0.1, 0.5)
    within: tuple[PositiveFloat, PositiveFloat] = (1e-3, 1e-2)


@dataclass(frozen=True, config=_STRICT)
class Retreat(ProgramStep):
    """A hand moves by a distance along its own axes.

    Attributes:
        hand: name of an ``EndEffector``. by: the distance along the hand's x, y and z [m].
        speed, within: as of :class:`Move`.
    """

    step: Literal["retreat"] = Field(default="retreat", kw_only=True)
    hand: str
    by: Three
    speed: tuple[PositiveFloat, PositiveFloat] = (0.1, 0.5)
    within: tuple[PositiveFloat, PositiveFloat] = (1e-3, 1e-2)


@dataclass(frozen=True, config=_STRICT)
class Approach(ProgramStep):
    """A hand moves in one direction until a guard holds, and fails if none does over the whole distance.

    Attributes:
        hand: name of an ``EndEffector``. along: direction in the axes of its reference frame.
        until: any of these ends the step: contact is a force above a threshold, nearness a distance below one.
        speed: [m/s]. at_most: distance after which the step has failed [m].
    """

    step: Literal["approach"] = Field(default="approach", kw_only=True)
    hand: str
    along: Three
    until: tuple[Guard, ...] = Field(min_length=1)
    speed: PositiveFloat = 0.01
    at_most: PositiveFloat = 0.1

    @model_validator(mode="after")
    def _direction(self) -> Approach:
        if not any(self.along):
            raise ValueError("along: expected a direction")
        return self


@dataclass(frozen=True, config=_STRICT)
class Operate(ProgramStep):
    """An operator moves a hand by twists in its reference frame, see :meth:`Runner.operate`.

    Where that frame is a moving one, the operator commands motion relative to the object and the controller adds the
    object's own.

    Attributes:
        hand: name of an ``EndEffector``. speed: largest speeds [m/s], [rad/s]; faster twists are scaled.
        until: what ends the step. stale: a twist counts for so long [s].
    """

    step: Literal["operate"] = Field(default="operate", kw_only=True)
    hand: str
    until: tuple[Guard, ...] = Field(min_length=1)
    speed: tuple[PositiveFloat, PositiveFloat] = (0.1, 0.5)
    stale: PositiveFloat = 0.5


@dataclass(frozen=True, config=_STRICT)
class Wait(ProgramStep):
    """Every hand keeps its pose in its reference frame, until a guard holds.

    Attributes:
        until: what ends the step; for a time: ``[{signal: elapsed, above: 2}]``.
    """

    step: Literal["hold"] = Field(default="hold", kw_only=True)
    until: tuple[Guard, ...] = Field(min_length=1)


@dataclass(frozen=True, config=_STRICT)
class Grasp(ProgramStep):
    """A gripper closes; done when it says that it holds."""

    step: Literal["grasp"] = Field(default="grasp", kw_only=True)
    gripper: str


@dataclass(frozen=True, config=_STRICT)
class Release(ProgramStep):
    """A gripper opens; done when it says that it is open."""

    step: Literal["release"] = Field(default="release", kw_only=True)
    gripper: str


@dataclass(frozen=True, config=_STRICT)
class Activate(ProgramStep):
    """Weights of tasks change smoothly; 0 switches a task off. Done when they are there.

    Attributes:
        weights: name of a task -> weight. seconds: how long it takes.
    """

    step: Literal["activate"] = Field(default="activate", kw_only=True)
    weights: dict[str, Annotated[float, Field(ge=0.0)]] = Field(min_length=1)
    seconds: float = Field(default=0.5, ge=0.0)


@dataclass(frozen=True, config=_STRICT)
class Alternatives(ProgramStep):
    """The first list of steps that succeeds; fails when all have."""

    step: Literal["alternatives"] = Field(default="alternatives", kw_only=True)
    tries: tuple[tuple[AnyStep, ...], ...] = Field(min_length=1)


AnyStep = Annotated[
    Move | Retreat | Approach | Operate | Wait | Grasp | Release | Activate | Alternatives, Field(discriminator="step")
]


@dataclass(frozen=True, config=_STRICT)
class Program(Declared):
    """Steps in order, what ends all of them, and what is done then.

    Attributes:
        steps: one after the other. abort: guards that end the program at any time; its hands stop within their limits.
        recovery: steps after a failure or an abort.

    Raises:
        ProgramError: what does not follow the schema, with the place and the value.
    """

    steps: tuple[AnyStep, ...] = Field(min_length=1)
    abort: tuple[Guard, ...] = ()
    recovery: tuple[AnyStep, ...] = ()

    @classmethod
    def read(cls, path: str | Path) -> Program:
        """A program from a YAML file.

            steps:
              - {step: move, hand: hand, to: {position: [0.5, 0.0, 0.3]}, timeout: 10}
              - {step: approach, hand: hand, along: [0, 0, -1], until: [{signal: force, above: 5}], at_most: 0.05}
              - {step: grasp, gripper: gripper, timeout: 2}
              - {step: retreat, hand: hand, by: [0, 0, -0.1]}
            abort: [{signal: distance, below: 0.01}]
            recovery:
              - {step: release, gripper: gripper}

        Raises:
            RobotFileError: no such file, or no YAML. ProgramError: another content.
        """
        try:
            content = yaml.safe_load(Path(path).read_text(encoding="utf-8"))
        except (OSError, UnicodeDecodeError, yaml.YAMLError) as error:
            raise RobotFileError("program", str(path), " ".join(str(error).split())) from error
        if not isinstance(content, dict):
            raise ProgramError("program", content, "expected a mapping with steps")
        return cls(**{str(key): value for key, value in content.items()})


for _recursive in (Alternatives, Program):
    rebuild_dataclass(_recursive)  # type: ignore[arg-type]

_KINDS: tuple[type[Any], ...] = (Move, Retreat, Approach, Operate, Wait, Grasp, Release, Activate, Alternatives)
_STEPS: dict[str, type[Any]] = {one.__name__.lower(): one for one in _KINDS}
#: What an unknown field may belong to, by the name that stands before it in an error's place
_PARTS: dict[str, type[Any]] = {
    **_STEPS,
    **{one.__name__: one for one in _KINDS},
    **dict.fromkeys(("Guard", "until", "unless", "abort"), Guard),
    **dict.fromkeys(("PoseTarget", "to"), PoseTarget),
    "Program": Program,
}


def _explained(kind: type, error: ValidationError) -> ProgramError:
    """The first thing that is wrong, by its place."""
    # A misspelt field comes before the one that is missing for it
    first = min(error.errors(), key=lambda one: one["type"] not in ("extra_forbidden", "unexpected_keyword_argument"))
    # Arguments are numbered: by their names in the order of the declaration
    names = [one.name for one in fields(kind) if not one.kw_only]
    loc = [names[part] if k == 0 and isinstance(part, int) else part for k, part in enumerate(first["loc"])]
    place = ".".join([kind.__name__, *(str(part) for part in loc)])
    if first["type"] == "union_tag_invalid":
        step = first["ctx"]["tag"]
        return ProgramError(f"{place}.step", step, "unknown step", nearest(step, _STEPS))
    if first["type"] in ("extra_forbidden", "unexpected_keyword_argument"):
        *_, owner, name = (kind.__name__, *(part for part in loc if isinstance(part, str)))
        known = tuple(one.name for one in fields(_PARTS[owner])) if owner in _PARTS else ()
        return ProgramError(place, first["input"], "unknown field", nearest(name, known))
    return ProgramError(place, first["input"], first["msg"].removeprefix("Value error, ").lower())
