"""What a program says: steps with guards, as a schema that Python and YAML share; see :meth:`Program.read`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, Literal

import pinocchio as pin
import yaml
from pydantic import BaseModel, ConfigDict, Field, PositiveFloat, ValidationError, model_validator
from pydantic._internal._model_construction import ModelMetaclass

from wbc.errors import RobotFileError, WbcError, nearest

Three = tuple[float, float, float]


class ProgramError(WbcError):
    """A program that does not follow the schema: ``field`` says where, ``value`` what stands there."""


class _Explaining(ModelMetaclass):
    """Makes one typed error of what the outermost part of a program finds wrong in itself and in its parts."""

    __pydantic_fields__: dict[str, Any]

    def __call__(cls, *positional: Any, **values: Any) -> Any:
        own = [name for name in cls.__pydantic_fields__ if name not in ("step", "name", "timeout", "unless")]
        try:
            return super().__call__(**dict(zip(own, positional, strict=False)), **values)
        except ValidationError as error:
            raise _explained(cls.__name__, error) from None


class Declared(BaseModel, metaclass=_Explaining):
    """What all parts of a program have in common: they do not change, and have no other fields than those declared."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)


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
    lasting: float = Field(0.0, ge=0.0)

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


class Pose(Declared):
    """Where a hand is to be, in the reference frame of its task.

    Attributes:
        position: [m]; None: where it is. quaternion: x, y, z, w; None: as it is turned.
    """

    position: Three | None = None
    quaternion: tuple[float, float, float, float] | None = None

    @model_validator(mode="after")
    def _unit(self) -> Pose:
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


class Step(Declared):
    """What all steps have in common.

    Attributes:
        name: for the log; default: what it does. timeout: the step fails after this time [s].
        unless: the step fails when one of these guards holds.
    """

    name: str = ""
    timeout: PositiveFloat | None = None
    unless: tuple[Guard, ...] = ()


class Move(Step):
    """A hand goes straight to a pose, and is there when its measured error is within the tolerance.

    Attributes:
        hand: name of an ``EndEffector`` of the stack. to: the pose. speed: largest speeds [m/s], [rad/s].
        within: largest distance [m] and angle [rad] at the end.
    """

    step: Literal["move"] = "move"
    hand: str
    to: Pose
    speed: tuple[PositiveFloat, PositiveFloat] = (0.1, 0.5)
    within: tuple[PositiveFloat, PositiveFloat] = (1e-3, 1e-2)


class Retreat(Step):
    """A hand moves by a distance along its own axes.

    Attributes:
        hand: name of an ``EndEffector``. by: the distance along the hand's x, y and z [m].
        speed, within: as of :class:`Move`.
    """

    step: Literal["retreat"] = "retreat"
    hand: str
    by: Three
    speed: tuple[PositiveFloat, PositiveFloat] = (0.1, 0.5)
    within: tuple[PositiveFloat, PositiveFloat] = (1e-3, 1e-2)


class Approach(Step):
    """A hand moves in one direction until a guard holds, and fails if none does over the whole distance.

    Attributes:
        hand: name of an ``EndEffector``. along: direction in the axes of its reference frame. speed: [m/s].
        until: any of these ends the step: contact is a force above a threshold, nearness a distance below one.
        at_most: distance after which the step has failed [m].
    """

    step: Literal["approach"] = "approach"
    hand: str
    along: Three
    speed: PositiveFloat = 0.01
    until: tuple[Guard, ...] = Field(min_length=1)
    at_most: PositiveFloat = 0.1

    @model_validator(mode="after")
    def _direction(self) -> Approach:
        if not any(self.along):
            raise ValueError("along: expected a direction")
        return self


class Operate(Step):
    """An operator moves a hand by twists in its reference frame, see :meth:`Runner.operate`.

    Where that frame is a moving one, the operator commands motion relative to the object and the controller adds the
    object's own.

    Attributes:
        hand: name of an ``EndEffector``. speed: largest speeds [m/s], [rad/s]; faster twists are scaled.
        until: what ends the step. stale: a twist counts for so long [s].
    """

    step: Literal["operate"] = "operate"
    hand: str
    until: tuple[Guard, ...] = Field(min_length=1)
    speed: tuple[PositiveFloat, PositiveFloat] = (0.1, 0.5)
    stale: PositiveFloat = 0.5


class Hold(Step):
    """Every hand keeps its pose in its reference frame, until a guard holds.

    Attributes:
        until: what ends the step; for a time: ``[{signal: elapsed, above: 2}]``.
    """

    step: Literal["hold"] = "hold"
    until: tuple[Guard, ...] = Field(min_length=1)


class Grasp(Step):
    """A gripper closes; done when it says that it holds."""

    step: Literal["grasp"] = "grasp"
    gripper: str


class Release(Step):
    """A gripper opens; done when it says that it is open."""

    step: Literal["release"] = "release"
    gripper: str


class Activate(Step):
    """Weights of tasks change smoothly; 0 switches a task off. Done when they are there.

    Attributes:
        weights: name of a task -> weight. seconds: how long it takes.
    """

    step: Literal["activate"] = "activate"
    weights: dict[str, Annotated[float, Field(ge=0.0)]] = Field(min_length=1)
    seconds: float = Field(0.5, ge=0.0)


class Alternatives(Step):
    """The first list of steps that succeeds; fails when all have."""

    step: Literal["alternatives"] = "alternatives"
    tries: tuple[tuple[AnyStep, ...], ...] = Field(min_length=1)


AnyStep = Annotated[
    Move | Retreat | Approach | Operate | Hold | Grasp | Release | Activate | Alternatives, Field(discriminator="step")
]


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


Alternatives.model_rebuild()

_KINDS: tuple[type[Step], ...] = (Move, Retreat, Approach, Operate, Hold, Grasp, Release, Activate, Alternatives)
_STEPS: dict[str, type[Declared]] = {str(one.model_fields["step"].default): one for one in _KINDS}
#: What an unknown field may belong to, by the name that stands before it in an error's place
_PARTS: dict[str, type[Declared]] = {
    **_STEPS,
    **{one.__name__: one for one in _KINDS},
    **dict.fromkeys(("Guard", "until", "unless", "abort"), Guard),
    **dict.fromkeys(("Pose", "to"), Pose),
    "Program": Program,
}


def _explained(kind: str, error: ValidationError) -> ProgramError:
    """The first thing that is wrong, by its place."""
    # A misspelt field comes before the one that is missing for it
    first = min(error.errors(), key=lambda one: one["type"] != "extra_forbidden")
    place = ".".join([kind, *(str(part) for part in first["loc"])])
    if first["type"] == "union_tag_invalid":
        return ProgramError(
            f"{place}.step", first["input"]["step"], "unknown step", nearest(first["ctx"]["tag"], _STEPS)
        )
    if first["type"] == "extra_forbidden":
        *_, owner, name = (kind, *(part for part in first["loc"] if isinstance(part, str)))
        fields = tuple(_PARTS[owner].model_fields) if owner in _PARTS else ()
        return ProgramError(place, first["input"], "unknown field", nearest(name, fields))
    return ProgramError(place, first["input"], first["msg"].removeprefix("Value error, ").lower())
