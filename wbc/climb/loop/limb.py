"""One limb in the loop: its state, its moves, and its items of the stack."""

from __future__ import annotations

from math import inf
from typing import Any

import numpy as np

from wbc.api import Stack
from wbc.climb.climber import ClimbLimb
from wbc.climb.loop.limb_state import CLOSED, Cause, LimbState, after
from wbc.climb.loop.reference import PlanReference
from wbc.climb.loop.stack import COMPONENTS, FootholdContact, contact_frame
from wbc.climb.plan import ContactMove, ContactPlan
from wbc.climb.scene import Foothold
from wbc.climb.stance import FREE_LIMB
from wbc.controller import core_of
from wbc.controller.handle import InputGroup
from wbc.multibody import pin
from wbc.simulation import GripKind, GrippingPlant
from wbc.validation import Array

#: How long before it lands a limb counts as reaching [s]
NEAR_LANDING = 0.1
#: How far from its foothold a limb closes by velocities [m]
NEAR_BY_RATES = 1e-3
#: The same by torques, which are not exact [m]
NEAR_BY_TORQUES = 3e-3
#: How far its z axis, or the pose where that is fixed, may be turned then [rad]
NEAR_TURN = 0.02
#: How long a plan waits for a limb that is late [s]
WAITS = 1.0
#: Time in which a limb hands over its load before it lifts, and takes it after it lands, by torques [s]
UNLOAD = 0.08
#: Speed at which a foot that is late goes on against its foothold's normal, by torques [m/s]
PRESSES = 0.02
#: Share of the coefficients of friction, and of soles, on which torques count [1]
COUNTED = 0.75
#: By torques, how much farther beside its foothold than that a foot may be as it closes [1]
BESIDE = 2.5
#: By torques, how much nearer to its surface than that a foot has to be [1]: below 1 mm its load hardly throws it
ABOVE = 3.0
#: How long a foot that is late has pressed on before it counts as standing within all of that [s]: tilted ones may
STANDS_LATE = 0.25
#: How far below its surface a foot is sent that has closed, until it bears its load [m]: of other masses than thought
#: it would stay above the surface, and be thrown at it by that load
SENT_BELOW = 2e-3
#: Weight of a contact's force that hands its load over [m^2/s^4 per N^2, of tasks of weight 1]: 1e4 leaves mN
UNLOADED = 1e4
#: The same in the air, where it is 0: of the size of other weights, as a tick takes longer where they are far apart
OPEN = 1.0
#: Rounding of times [s]
INSTANT = 1e-9


class LimbMachine:
    """A limb's state as of :class:`LimbState`, and what a change of it means for stack and plant.

    Args:
        limb: which. stack, controller: of :func:`climb_stack`. plant: that grips; None: it does not. torques: whether
            torques are commanded.

    Attributes:
        item: its contact in the stack. state: now. held: row of the foothold that it is closed on, or ``FREE_LIMB``.
        frame: name of its contact frame. moves: those of the plan that are not over.
    """

    def __init__(
        self, limb: ClimbLimb, stack: Stack, controller: Any, plant: GrippingPlant | None, torques: bool
    ) -> None:
        self.name, self._kind, self._plant, self._torques = limb.name, limb.contact, plant, torques
        self.frame, self._model, self._dt = contact_frame(limb), stack.robot.model, stack.dt
        self._number = self._model.getFrameId(self.frame)
        self._gripping, self._closed_at = False, (np.zeros(3), 0.0)
        self._contact, self._swing = controller[f"{self.name} contact"], controller[f"{self.name} swing"]
        self._force = controller[f"{self.name} contact force"] if torques else None
        self._bearing = 0.0 if self._force is None else self._force.weight
        item: Any = stack[f"{self.name} contact"].item
        self.item: FootholdContact = item
        fields = ("target", "feedforward", *(["acceleration"] * torques))
        self._aim = InputGroup(core_of(controller), [(f"{self.name} swing", field, None) for field in fields])
        self._glide = InputGroup(core_of(controller), [(f"{self.name} contact", "feedforward", None)])
        self._loading = UNLOAD if torques else 0.0
        self._presses = torques and not limb.contact.pulls
        self._near = NEAR_BY_TORQUES if torques else NEAR_BY_RATES
        self._data = self._model.createData()
        self.state, self.held, self._since = LimbState.FREE, FREE_LIMB, 0.0
        self._late, self.moves, self._target = 0.0, list[ContactMove](), pin.SE3.Identity()
        self._footholds: tuple[Foothold, ...] = ()
        self._contact.enabled = False

    # ------------------------------------------------------------------ plans

    def begin(self, moves: list[ContactMove], plan: ContactPlan, reference: PlanReference, held: int) -> None:
        """A plan begins, in which this limb has these moves and is closed on a foothold, or not."""
        self.moves, self._footholds, self._reference = moves, tuple(plan.scene.footholds), reference
        self._gone, self._late, self.held = set[int](), 0.0, held
        self._rate = np.zeros(3 if self._kind.fixed == "position" else 6)

    def stand(self, foothold: int, q: Array, now: float) -> str:
        """Closed from the beginning; what keeps it from there, "" for nothing."""
        self._target = self._at(foothold, 0.0)
        off, turned = self.off(q)
        if off > 10.0 * self._near or turned > 10.0 * NEAR_TURN:
            return f"{self.name} is {off:.3g} m and {turned:.3g} rad off {self._footholds[foothold].id}"
        self.state, self._since = LimbState.HELD, now
        self._close(foothold, q)
        return ""

    @property
    def coming(self) -> ContactMove | None:
        """The move that is under way or comes next; None: no more."""
        return self.moves[0] if self.moves else None

    @property
    def aim(self) -> int:
        """Row of the foothold that it is on its way to through the air, or ``FREE_LIMB``."""
        move = self.coming
        under_way = self.state in (LimbState.SWINGING, LimbState.REACHING)
        return move.lands if under_way and move is not None else FREE_LIMB

    def missing(self, rows: set[int]) -> str:
        """Footholds are gone: what of this limb's plan cannot be done, in words; "" for nothing."""
        said = ""
        if self.state in CLOSED and self.held in rows:
            said = f"the foothold {self._footholds[self.held].id} of {self.name} is gone"
        for move in self.moves:
            if move.lands in rows:
                self._gone.add(move.lands)
                said = said or f"the foothold {self._footholds[move.lands].id} that {self.name} was to land on is gone"
        return said

    # ------------------------------------------------------------------ states

    @property
    def due(self) -> float:
        """Time of the plan before which its state does not change [s]."""
        move, state = self.coming, self.state
        if state in (LimbState.UNLOADING, LimbState.LATCHING):
            return -inf
        if move is None:
            return inf
        if state in (LimbState.HELD, LimbState.FREE):
            return move.lift - self._loading
        return move.land - NEAR_LANDING if state is LimbState.SWINGING else -inf

    def loaded(self, now: float) -> bool:
        """Whether the time in which a load is handed over has passed since it last changed."""
        return now - self._since + INSTANT >= self._loading

    def unloaded(self, now: float) -> bool:
        """Whether it has handed its load over, or bears none that counts."""
        return self._loading == 0.0 or (self.state is LimbState.UNLOADING and self.loaded(now))

    def landed(self, time: float) -> bool:
        """Whether it has done what the plan has it do until a time of the plan."""
        move = self.coming
        return move is None or move.land > time + INSTANT

    def cause(self, ahead: float, path_time: float, q: Array, now: float, borne: bool) -> Cause | None:
        """What changes its state by now; None: nothing.

        Args:
            ahead: time of the plan at the end of the tick. path_time: now. q: where the robot is. now: clock [s].
            borne: whether the limbs that are to bear the robot when this one lifts do.
        """
        state, move = self.state, self.coming
        if state is LimbState.LATCHING:
            return Cause.SETTLED if self.loaded(now) else None
        if move is None:
            return None
        if state is LimbState.HELD:
            return Cause.LIFT_NEARS if borne and ahead > move.lift - self._loading else None
        if state is LimbState.UNLOADING:
            return Cause.UNLOADED if ahead > move.lift and self.loaded(now) else None
        if state is LimbState.FREE:
            return Cause.LIFT_NEARS if borne and ahead > move.lift else None
        if state is LimbState.SWINGING:
            if move.lands == FREE_LIMB:
                return Cause.NO_FOOTHOLD if ahead >= move.land else None
            return Cause.LANDING_NEARS if ahead >= move.land - NEAR_LANDING else None
        if path_time < move.land - INSTANT or move.lands in self._gone:
            return None
        return Cause.AT_FOOTHOLD if self._there(q) else None

    def wait(self, path_time: float) -> bool:
        """Whether the plan has to wait for it, a tick more."""
        move = self.coming
        if self.state is not LimbState.REACHING or move is None or path_time < move.land - INSTANT:
            return False
        self._late += self._dt
        return True

    def too_late(self, q: Array) -> str:
        """What keeps it from its foothold for longer than is waited, in words; "" for nothing."""
        move = self.coming
        if self._late <= WAITS or move is None:
            return ""
        off, turned = self.off(q)
        return (
            f"{self.name} did not come to {self._footholds[move.lands].id}: {1e3 * off:.2f} mm and {turned:.3f} rad "
            f"off after {WAITS:g} s; {1e3 * self._near:g} mm and {NEAR_TURN:g} rad are allowed"
        )

    def change(self, cause: Cause, q: Array, now: float) -> LimbState:
        """Its next state, as of the table; stack and plant are told."""
        before = self.state
        state = self.state = after(before, cause)
        self._since, move = now, self.coming
        if state is LimbState.UNLOADING and self._force is not None:
            self._force.ramp(UNLOADED, self._loading)
        elif before in CLOSED and state not in CLOSED:
            self._open()
        elif state is LimbState.LATCHING and move is not None:
            self._close(move.lands, q)
        elif cause is Cause.NEW_PLAN and state is LimbState.HELD and self._force is not None:
            self._force.ramp(self._bearing, self._loading)
        elif cause in (Cause.SETTLED, Cause.NO_FOOTHOLD):
            self.moves = self.moves[1:]
            if cause is Cause.SETTLED and self._presses:
                # Friction holds it where it landed: a target elsewhere would only load that
                self._contact.target = self._stood(q, 0.0)
        if state is LimbState.SWINGING and move is not None and move.lands != FREE_LIMB:
            self._target = self._at(move.lands, move.land)
        return state

    # ------------------------------------------------------------------ stack and plant

    def follow(self, planned: pin.Data) -> None:
        """In the air the contact frame follows the plan; a closed contact goes on over a tick as it does in the plan,
        whose tips are where they are at its ends while J v is not 0.

        Args:
            planned: with the kinematics of the plan now, and of its velocity over the tick.
        """
        rate = pin.getFrameVelocity(self._model, planned, self._number, pin.LOCAL_WORLD_ALIGNED).vector
        if self.held != FREE_LIMB:
            self._glide.write(rate)
            return
        now = pin.updateFramePlacement(self._model, planned, self._number)
        place = now.translation
        if self._late > 0.0 and self._presses:
            normal = self._target.rotation[:, 2]
            place, rate[:3] = place - PRESSES * self._late * normal, rate[:3] - PRESSES * normal
        aim = [place]
        if self._kind.fixed == "position":
            rate = rate[:3]
        else:
            aim = [now.rotation.T.ravel(), place]
        aim.append(rate)
        if self._torques:
            aim.append((rate - self._rate) / self._dt)
            self._rate = rate
        self._aim.write(np.concatenate(aim))

    def off(self, q: Array) -> tuple[float, float]:
        """How far it is from its foothold [m], and how far turned as far as its contact fixes that [rad]."""
        pose, target = self._pose(q), self._target
        off = float(np.linalg.norm(pose.translation - target.translation))
        if self._kind.fixed == "position":
            return off, 0.0
        if self._kind.fixed == "axis":
            return off, float(np.arccos(np.clip(pose.rotation[:, 2] @ target.rotation[:, 2], -1.0, 1.0)))
        return off, float(np.linalg.norm(pin.log3(pose.rotation.T @ target.rotation)))

    def torn(self) -> Foothold:
        """The plant's grip is gone; what it held."""
        self._gripping = False
        return self._footholds[self.held]

    def slipped(self, seen: pin.Data) -> float:
        """How far a grip has gone from where it closed, what it came nearer to its foothold left out [m].

        Args:
            seen: with the kinematics of where the robot is.
        """
        if not self._gripping:
            return 0.0
        place = pin.updateFramePlacement(self._model, seen, self._number).translation
        first, off = self._closed_at
        nearer = max(off - float(np.linalg.norm(place - self._target.translation)), 0.0)
        return float(np.linalg.norm(place - first)) - nearer

    def fixing(self, seen: pin.Data) -> Array:
        """Rows of its contact frame's Jacobian that a closed contact fixes.

        Args:
            seen: with the joints' Jacobians of where the robot is.
        """
        rows = pin.getFrameJacobian(self._model, seen, self._number, pin.ReferenceFrame.LOCAL)
        return np.asarray(rows[list(COMPONENTS[self._kind.fixed])])

    def _there(self, q: Array) -> bool:
        """Whether it is near enough to its foothold to close; a foot that touches, also a little beside it."""
        off, turned = self.off(q)
        if self._presses:
            away = self._target.actInv(self._pose(q)).translation
            above = ABOVE if self._late < STANDS_LATE else 1.0
            off = max(above * float(away[2]), -float(away[2]), float(np.hypot(away[0], away[1])) / BESIDE)
        return off <= self._near and turned <= NEAR_TURN

    def _close(self, foothold: int, q: Array) -> None:
        """Its rows are hard."""
        target, inputs = self._target, dict[str, Any]()
        if self._force is not None:
            if self._presses:
                # Where the foot is, which may be a little beside the plan's foothold
                above = float(target.rotation[:, 2] @ (self._pose(q).translation - target.translation))
                target = self._stood(q, max(0.0, above + SENT_BELOW) if self.state is LimbState.LATCHING else 0.0)
            slopes, bounds = self.item.numbers(self._footholds[foothold].friction, COUNTED)
            inputs = {"slopes": slopes, "bounds": bounds}
            if self.state is LimbState.LATCHING:
                # It has no load yet: a force that nothing answers would throw the limb at what it is to hold
                self._force.weight = UNLOADED
            self._force.ramp(self._bearing, self._loading)
        self._contact.set(target=target, **inputs)
        self._contact.enabled, self._swing.enabled = True, False
        if self._plant is not None and self._kind.pulls:
            self._plant.grasp(self.frame, target, GripKind(self._kind.fixed))
            place, self._gripping = self._pose(q).translation, True
            self._closed_at = place, float(np.linalg.norm(place - target.translation))
        self.held, self._late = foothold, 0.0

    def _stood(self, q: Array, down: float) -> pin.SE3:
        """Pose of the contact frame of a foot where it is, or so far down along its surface's normal [m]."""
        pose, surface = self._pose(q), self._target.rotation
        turn = surface if self._kind.fixed == "position" else pose.rotation
        return pin.SE3(turn, pose.translation - down * surface[:, 2])

    def _open(self) -> None:
        """It follows the plan through the air."""
        self._contact.enabled, self._swing.enabled = False, True
        if self._force is not None:
            self._force.weight = OPEN
        if self._plant is not None and self._gripping:
            self._plant.release(self.frame)
        self._gripping = False
        self.held, self._late = FREE_LIMB, 0.0
        self._rate = np.zeros(3 if self._kind.fixed == "position" else 6)

    def _at(self, foothold: int, time: float) -> pin.SE3:
        """The contact pose at a foothold: its place and normal, and the turn about it that the plan has."""
        pose = self._kind.held_at(self._footholds[foothold].pose)
        if self._kind.fixed == "position":
            return pin.SE3(pose)
        z, x = pose.rotation[:, 2], self._pose(self._reference.q(time)).rotation[:, 0]
        x = x - (x @ z) * z
        x /= np.linalg.norm(x)
        return pin.SE3(np.column_stack([x, np.cross(z, x), z]), pose.translation)

    def _pose(self, q: Array) -> pin.SE3:
        """Of the contact frame."""
        pin.forwardKinematics(self._model, self._data, q)
        return pin.updateFramePlacement(self._model, self._data, self._number).copy()
