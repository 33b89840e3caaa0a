"""The plant that a walk is asked to run on, by name."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from wbc import validation
from wbc.errors import RangeError, WbcError
from wbc.walking.torque.faults import Fault, delay_of

if TYPE_CHECKING:
    from wbc.robots import Walker
    from wbc.walking.holds.structure import Structure
    from wbc.walking.torque.loop import TorqueLoop
    from wbc.walking.torque.tested import Tested


@dataclass(frozen=True)
class PlantChoice:
    """What moves under a walk.

    Attributes:
        name: kinematic: joints do exactly as they are commanded; or under torques, on holds that fix the tilt of a
            hand, --rigid: pinocchio (rigid grips) or mujoco (soft ones).
        gravity: x,y,z along the structure's axes; of plants with torques [m/s^2].
        faults: 'slip ARM METRES at SECONDS', 'limp JOINT at SECONDS', 'break ARM at SECONDS' or 'delay SECONDS'; may
            be repeated.

    Raises:
        UnknownNameError, ShapeError, RangeError: a name or a text that is none; gravity or faults of the kinematic
            plant.
    """

    name: str = field(default="kinematic", metadata={"option": "plant"})
    gravity: tuple[float, float, float] = (0.0, 0.0, 0.0)
    faults: tuple[str, ...] = field(default=(), metadata={"option": "fault"})

    def __post_init__(self) -> None:
        from wbc.simulation.drives import PLANTS

        validation.one_of("plant", self.name, PLANTS)
        gravity = validation.real_array("gravity", self.gravity, (3,)).tolist()
        object.__setattr__(self, "gravity", tuple(gravity))
        if self.name == "kinematic" and (any(gravity) or self.faults):
            raise RangeError("plant", self.name, "it has no masses, so no gravity and no faults")
        delay_of(tuple(map(Fault.read, self.faults)))

    @classmethod
    def of_run(cls, about: Mapping[str, Any]) -> PlantChoice:
        """That of a run which was begun: plain data of :meth:`about`, empty for the kinematic one.

        Raises:
            WalkLogError: it is none.
        """
        from wbc.walking.log.log import WalkLogError

        try:
            x, y, z = about.get("gravity", (0.0, 0.0, 0.0))
            return cls(about.get("name", "kinematic"), (x, y, z), tuple(about.get("faults", ())))
        except (TypeError, ValueError, WbcError) as error:
            raise WalkLogError("plant", str(about), f"the run does not say what moved: {error}") from error

    @property
    def about(self) -> dict[str, Any]:
        """As plain data."""
        return {"name": self.name, "gravity": list(self.gravity), "faults": list(self.faults)}

    @property
    def dynamic(self) -> bool:
        """It has masses and takes torques."""
        return self.name != "kinematic"

    def build(self, walker: Walker, structure: Structure, backend: str = "auto") -> TorqueLoop:
        """The plant with the loop of torques over it, for a walker without masses.

        Raises:
            MissingPackageError: MuJoCo is not installed. ShapeError: another machine.
            RangeError: holds that let hands tilt. UnknownNameError: a fault of an arm or a joint that is not there.
        """
        from wbc.robots import with_masses
        from wbc.simulation import GripKind, GrippingMujocoPlant, Motors, PinocchioPlant
        from wbc.walking.torque.loop import TorqueLoop
        from wbc.walking.torque.stack import TorqueStack

        heavy, faults = with_masses(walker, self.gravity), tuple(map(Fault.read, self.faults))
        for fault in faults:
            if fault.kind == "limp":
                heavy.robot.dofs(fault.what)
            elif fault.kind != "delay":
                heavy.arm(fault.what)
        kinds = [GripKind(hold_kind_of(structure, k)) for k in range(len(structure))]
        stack = TorqueStack(heavy, kinds, backend=backend)
        delay = delay_of(faults)
        motors = Motors(delay=delay)
        plant: Tested
        if self.name == "pinocchio":
            plant = PinocchioPlant(heavy.robot, stack.controller.stack.dt, integrator="midpoint", motors=motors)
        else:
            hands = [arm.hand for arm in heavy.arms]
            plant = GrippingMujocoPlant(heavy.robot, hands, stack.controller.stack.dt, motors=motors)
        return TorqueLoop(stack, plant, delay=delay, faults=faults, about=self.about)


def hold_kind_of(structure: Structure, hold: int) -> str:
    """How a hold holds a hand, in a word that :class:`GripKind` has.

    Raises:
        RangeError: it lets the hand tilt but not roll.
    """
    from wbc.walking.loop.stack import hold_kind

    kind = hold_kind(structure, hold)
    if kind == "roll":
        reason = "torques know holds that fix a hand, leave its roll, or leave tilt and roll; not the tilt alone"
        raise RangeError(f"hold {structure.ids[hold]}", kind, reason)
    return kind
