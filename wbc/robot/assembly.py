"""From a description to a :class:`~wbc.robot.Robot`: neutral configuration, couplings, locked joints, limits."""

from __future__ import annotations

import logging
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from wbc import validation
from wbc.errors import BoundsError, DuplicateNameError, RangeError, ShapeError, UnsupportedJointError
from wbc.multibody import algebra, pin
from wbc.robot.frames import make_frames_unique
from wbc.robot.limits import Limits
from wbc.robot.loops import AnyLoop, JointCurve, LoopError
from wbc.robot.rebuilt import without_joints
from wbc.robot.recipe import Recipe, expand
from wbc.robot.robot import Coupling, Robot, changed
from wbc.robot.sources.description import Description, Mimic, finite_or_unlimited
from wbc.symbolic.joints import symbolic_joint
from wbc.symbolic.kinematics import WORLD
from wbc.validation import Array

#: Two values of a joint this close are one [rad or m]
SAME_VALUE = 1e-9

#: What loops may move the neutral configuration by in silence: numbers of files are rounded [rad or m]
SLIGHT = 1e-2
#: Random starts from which loops are closed with joints where they are given
SEARCHES = 20

#: What Pinocchio has as position limits of the numbers of a quaternion or (cos, sin), which limit nothing
PIN_UNIT = 1.01

log = logging.getLogger("wbc")

_NO_ACCELERATION = "none known: unlimited"


def assemble(description: Description, recipe: Recipe, states: Mapping[str, Mapping[str, Array]]) -> Robot:
    """The robot of a description, made as the recipe says; ``states`` are named configurations to choose from.

    Raises:
        DuplicateNameError: two joints of one name, or one with that of the world, ``universe``.
        UnknownNameError: a joint, frame or state of the recipe that the description does not have.
        UnsupportedJointError: a joint that moves and that the symbolic kinematics do not cover; joints of a branch that
            do not come one after another.
        RangeError: two ends of a mimic pair locked at values that contradict each other.
    """
    notes = dict(description.notes)
    model = description.model
    _check_names(model)
    _check_order(model)
    mimics, standing = resolve_mimics(description.mimics, model)
    q, remarks = neutral_configuration(model, mimics, recipe, states)
    if remarks:
        notes["neutral"] = remarks
    driven = _moving(model)[0 if description.base == "fixed" else 1 :]
    lock = expand("lock", recipe.lock, driven)
    for name, value in standing.items():
        given = lock.get(name)
        if given is not None and abs(given - value) > SAME_VALUE:
            raise RangeError(f"lock[{name!r}]", given, f"it follows a fixed joint, which puts it at {value:.9g}")
    for pair in zip(model.mimicked_joints, model.mimicking_joints, strict=True):
        leader, follower = (str(model.names[j]) for j in pair)
        if {leader, follower} & set(lock):  # Pinocchio's own mimic joints, which have no coordinates
            lock = {leader: None, follower: None, **lock}
    locked = _locked(model, mimics, {**lock, **standing}, q)
    model, q, renamed = _reduced(model, with_values(model, q, locked), list(locked))
    if locked:
        shown = (f"{name} at {' '.join(f'{x:.6g}' for x in value)}" for name, value in locked.items())
        notes["lock"] = "locked: " + ", ".join(shown)
    if renamed:
        notes["frames"] = "joints' frames that share a link's name: " + ", ".join(
            f"{old} is now {new}" for old, new in renamed.items()
        )
    if any(str(frame.name) == WORLD and frame.parentJoint > 0 for frame in model.frames):
        notes["world"] = f"the link {WORLD!r} moves, and this name is that of the fixed world: nothing names the link"
        log.warning("%s: %s", description.source or model.name, notes["world"])
    for j in range(1, model.njoints):
        if "Mimic" not in model.joints[j].shortname():  # a joint without coordinates of its own
            symbolic_joint(model.joints[j], str(model.names[j]))
    couplings = tuple(
        Coupling(
            int(model.idx_vs[model.getJointId(m.follower)]),
            int(model.idx_vs[model.getJointId(m.leader)]),
            m.ratio,
            m.offset,
        )
        for m in mimics
        if m.follower not in locked
    )
    limits = read_limits(model, description.base, notes)
    undriven = {name: model.getJointId(name) for name in description.undriven if model.existJointName(name)}
    locked_dofs = tuple(int(model.idx_vs[j]) + k for j in undriven.values() for k in range(int(model.nvs[j])))
    if description.base == "differential":
        locked_dofs = (1, *locked_dofs)
        notes["base"] = "differential drive: the sideways velocity of the base (index 1 of v) must stay 0"
    robot = Robot(
        recipe.name,
        model,
        limits,
        description.base,
        q,
        couplings=couplings,
        frames=recipe.frames,
        notes=notes,
        locked_dofs=locked_dofs,
        source=description.source,
    )
    robot = _actuated(robot, description, recipe)
    for role, frame in recipe.frames.items():
        robot.check_frame(f"frames.{role}", frame)
    loops = tuple(_unlocked(loop, locked) for loop in (*description.loops, *recipe.more_loops))
    if description.loops and not recipe.loops:
        names = ", ".join(loop.name for loop in description.loops)
        log.warning("%s: loops that are not kept closed, as load(loops=False) asked: %s", robot.name, names)
    elif loops:
        robot = _closed(robot, loops, recipe.neutral)
    if still := [name for name, j in undriven.items() if int(model.idx_vs[j]) in robot.locked_dofs]:
        said = f"nothing drives {', '.join(still)}, which is no base: its velocity must stay 0"
        log.warning("%s: %s", description.source or model.name, said)
        robot = changed(robot, notes={**robot.notes, "undriven": said})
    return _with_accelerations(robot, {**description.acceleration, **recipe.acceleration}, recipe.source)


def _actuated(robot: Robot, description: Description, recipe: Recipe) -> Robot:
    """The robot with motors where the recipe, or else the description, says; locked joints have none to name."""
    said = description.actuated
    if recipe.actuated == "transmissions":
        said = description.transmissions
        if not said:
            raise RangeError("actuated", recipe.actuated, "the description has no transmission of a joint")
    elif recipe.actuated is not None:
        return robot.with_actuated(recipe.actuated)
    moved = [name for name in said if name in robot.joint_names]
    return robot.with_actuated(moved) if moved else robot


def _closed(robot: Robot, loops: Sequence[AnyLoop], given: Mapping[str, float]) -> Robot:
    """The robot with loops; joints with given values have them in ``neutral`` where loops close so, and where it is
    elsewhere than the description says is noted.
    """
    closed, start = robot.with_loops(*loops), robot.neutral
    single = [name for name in robot.joint_names if robot.position_index[robot.dofs(name).start] >= 0]
    kept = {name: float(start[robot.position_index[robot.dofs(name).start]]) for name in single if name in given}
    modes = closed.assemblies(kept, count=SEARCHES) if kept else ()
    closed = replace(closed, neutral=modes[0]) if modes else closed
    gaps, moved = closed.loop_gaps(start), np.abs(closed.difference(start, closed.neutral))
    worst, furthest = max(gaps, key=lambda name: gaps[name]), int(moved.argmax())
    if moved[furthest] <= SLIGHT:
        return closed
    said = f"{worst} is open by {gaps[worst]:.3g} m or rad there: moved to where loops are closed, "
    said += f"{robot.dof_names[furthest]} by {moved[furthest]:.3g} {robot.dof_units[furthest]}"
    said = f"{closed.notes['neutral']}; {said}" if "neutral" in closed.notes else said
    # What follows a curve is where that says, as what is coupled; frames that are apart are a mistake of the file
    if not modes and any(gaps[loop.name] > SLIGHT for loop in loops if not isinstance(loop, JointCurve)):
        log.warning("%s: neutral configuration: %s", robot.name, said)
    return changed(closed, notes={**closed.notes, "neutral": said})


def _unlocked(loop: AnyLoop, locked: Mapping[str, Array]) -> AnyLoop:
    """A loop of a robot of which some joints are locked: what follows one of them stands still."""
    if not isinstance(loop, JointCurve) or not {loop.follower, loop.leader} & set(locked):
        return loop
    if loop.follower in locked:
        raise LoopError(f"lock[{loop.follower!r}]", locked[loop.follower], f"it follows {loop.leader}: lock that")
    assert loop.leader is not None
    away = float(locked[loop.leader][0]) - loop.origin[1]
    value = float(np.polynomial.polynomial.polyval(away, loop.coefficients))
    return replace(loop, leader=None, coefficients=(value,))


def _check_names(model: pin.Model) -> None:
    world, *names = map(str, model.names)
    taken = {world}
    for name in names:
        if name in taken:
            reason = "a joint has the name of the world" if name == world else "two joints have this name"
            raise DuplicateNameError("robot", name, reason)
        taken.add(name)


def _check_order(model: pin.Model) -> None:
    """Branch by branch, as files are read: else ``pin.crba`` and derivatives of ``pin.rnea`` are silently wrong."""
    for j in range(1, model.njoints):
        at, parent = j - 1, int(model.parents[j])
        while at > parent:
            at = int(model.parents[at])
        if at != parent:
            reason = f"its parent {model.names[parent]} does not carry {model.names[j - 1]}, the joint before it"
            raise UnsupportedJointError(
                "robot", str(model.names[j]), f"{reason}: Pinocchio wants the joints of a branch one after another"
            )


def _moving(model: pin.Model) -> list[str]:
    return [str(name) for name in list(model.names)[1:]]


def _with_accelerations(robot: Robot, values: Mapping[str, float], source: str) -> Robot:
    known = {name: value for name, value in values.items() if name in robot.joint_names}
    note = _NO_ACCELERATION
    if known:
        note = source or "given with the description"
        if len(known) < len(robot.joint_names):
            note += "; none known for the other joints: unlimited"
        robot = robot.with_limits(acceleration=known)
    return changed(robot, notes={**robot.notes, "acceleration": note})


def resolve_mimics(mimics: tuple[Mimic, ...], model: pin.Model) -> tuple[tuple[Mimic, ...], dict[str, float]]:
    """(mimics between joints that move, chains replaced by their first leader; where followers of fixed joints stand).

    Raises:
        RangeError: joints that follow each other in a circle, or a mimic of a joint with several numbers.
    """
    by_follower = {m.follower: m for m in mimics if model.existJointName(m.follower)}
    out, standing = [], {}
    for mimic in by_follower.values():
        leader, ratio, offset = mimic.leader, mimic.ratio, mimic.offset
        for _ in by_follower:
            above = by_follower.get(leader)
            if above is None:
                break
            leader, ratio, offset = above.leader, ratio * above.ratio, ratio * above.offset + offset
        if leader in by_follower:
            raise RangeError("mimic", leader, "these joints follow each other in a circle")
        for name in (mimic.follower, leader):
            if model.existJointName(name) and model.nqs[model.getJointId(name)] != 1:
                raise RangeError("mimic", name, "only joints with one coordinate can be coupled")
        if model.existJointName(leader):
            out.append(Mimic(mimic.follower, leader, ratio, offset))
        else:
            standing[mimic.follower] = offset
    return tuple(out), standing


def neutral_configuration(
    model: pin.Model, mimics: tuple[Mimic, ...], recipe: Recipe, states: Mapping[str, Mapping[str, Array]]
) -> tuple[Array, str]:
    """(q, what had to be changed): the recipe's state and numbers on top of ``pin.neutral``, then put within limits.

    A joint whose value is outside its limits gets the nearest limit if somebody asked for that value, and
    the middle of its range if it is merely zero.
    """
    values: dict[str, Array] = {}
    where = "zero"
    if not recipe.state:
        # A base stands where the file draws it
        values |= {k: v for k, v in states.get("qpos0", {}).items() if len(v) > 1 and _fits(model, k, v)}
    else:
        validation.one_of("state", recipe.state, tuple(states))
        state = states[recipe.state]
        values |= {k: v for k, v in state.items() if _fits(model, k, v)}
        where = f"state {recipe.state!r} ({len(values)} of its {len(state)} joints are here)"
    for name, number in recipe.neutral.items():
        validation.one_of("neutral", name, _moving(model))
        values[name] = validation.real_array(f"neutral[{name!r}]", number).reshape(-1)
    q = with_values(model, algebra(model).neutral(model), values)
    lower, upper = _ranges(model, mimics)
    moved = []
    for j in range(1, model.njoints):
        if model.nqs[j] != model.nvs[j]:
            continue
        name = str(model.names[j])
        for i in range(model.idx_qs[j], model.idx_qs[j] + model.nqs[j]):
            low, high = lower[i], upper[i]
            if low <= q[i] <= high:
                continue
            middle = name not in values and np.isfinite(low) and np.isfinite(high)
            q[i] = (low + high) / 2 if middle else np.clip(q[i], low, high)
            moved.append(name)
    for mimic in mimics:
        follower, leader = (int(model.idx_qs[model.getJointId(n)]) for n in (mimic.follower, mimic.leader))
        q[follower] = np.clip(
            mimic.ratio * q[leader] + mimic.offset,
            model.lowerPositionLimit[follower],
            model.upperPositionLimit[follower],
        )
    if recipe.neutral:
        where += f" with given values of {', '.join(recipe.neutral)}"
    return q, f"{where}; put within limits: {', '.join(dict.fromkeys(moved))}" if moved else where


def _fits(model: pin.Model, name: str, values: Array) -> bool:
    """Whether a joint of this name moves in the model and takes that many numbers."""
    if not model.existJointName(name):
        return False
    j = model.getJointId(name)
    return len(values) == model.nqs[j] or (len(values) == 1 and (model.nqs[j], model.nvs[j]) == (2, 1))


def _ranges(model: pin.Model, mimics: tuple[Mimic, ...]) -> tuple[Array, Array]:
    """Position limits by coordinate; a leader's are cut so that its followers stay within theirs, where that can be."""
    lower, upper = finite_or_unlimited(model.lowerPositionLimit), finite_or_unlimited(model.upperPositionLimit)
    for mimic in mimics:
        follower, leader = (int(model.idx_qs[model.getJointId(n)]) for n in (mimic.follower, mimic.leader))
        if mimic.ratio == 0.0:
            continue
        ends = sorted((bound[follower] - mimic.offset) / mimic.ratio for bound in (lower, upper))
        low, high = max(lower[leader], ends[0]), min(upper[leader], ends[1])
        if low <= high:
            lower[leader], upper[leader] = low, high
    return lower, upper


def with_values(model: pin.Model, q: Array, values: Mapping[str, Array]) -> Array:
    """A copy of q with the coordinates of some joints replaced; an angle goes to an unbounded joint as (cos, sin).

    Raises:
        ShapeError: a joint given another number of values than it has coordinates.
    """
    out = np.array(q)
    for name, value in values.items():
        j = model.getJointId(name)
        nq, start = int(model.nqs[j]), int(model.idx_qs[j])
        if len(value) == 1 and (nq, int(model.nvs[j])) == (2, 1):
            value = np.array([np.cos(value[0]), np.sin(value[0])])
        if len(value) != nq:
            raise ShapeError(f"neutral[{name!r}]", value, f"expected {nq} numbers")
        out[start : start + nq] = value
    return np.asarray(algebra(model).normalize(model, out), dtype=np.float64)


def _locked(
    model: pin.Model, mimics: tuple[Mimic, ...], lock: Mapping[str, float | None], q: Array
) -> dict[str, Array]:
    """Joint name -> where it is locked; locking one end of a mimic pair locks the other where the coupling puts it."""
    values: dict[str, Array] = {}
    for name, value in lock.items():
        if value is not None and model.nvs[model.getJointId(name)] != 1:
            raise ShapeError(f"lock[{name!r}]", value, "a joint with several degrees of freedom is locked as it is")
        values[name] = _coordinates(model, name, q) if value is None else np.array([value])
    for mimic in mimics:
        if mimic.follower in values and mimic.leader not in values and mimic.ratio != 0.0:
            given = lock[mimic.follower]
            at_rest = _coordinates(model, mimic.leader, q)
            values[mimic.leader] = at_rest if given is None else np.array([(given - mimic.offset) / mimic.ratio])
    for mimic in mimics:
        if mimic.leader not in values:
            continue
        coupled = mimic.ratio * values[mimic.leader] + mimic.offset
        given = lock.get(mimic.follower)
        if given is not None and abs(given - coupled[0]) > SAME_VALUE:
            reason = f"it follows {mimic.leader}, which puts it at {coupled[0]:.9g}"
            raise RangeError(f"lock[{mimic.follower!r}]", given, reason)
        values[mimic.follower] = coupled
    return values


def _coordinates(model: pin.Model, name: str, q: Array) -> Array:
    j = model.getJointId(name)
    return np.array(q[model.idx_qs[j] : model.idx_qs[j] + model.nqs[j]])


def _reduced(model: pin.Model, q: Array, locked: list[str]) -> tuple[pin.Model, Array, dict[str, str]]:
    """(model without the locked joints, its part of q, frames renamed to make their names unique)."""
    start = {str(model.names[j]): int(model.idx_qs[j]) for j in range(1, model.njoints)}
    indices = [model.getJointId(name) for name in locked]
    reduced = without_joints(model, indices, q) if locked else algebra(model).Model(model)
    renamed = make_frames_unique(reduced)
    parts = []
    for j in range(1, reduced.njoints):
        first = start[str(reduced.names[j])]
        parts.append(q[first : first + int(reduced.nqs[j])])
    return reduced, np.concatenate([np.zeros(0), *parts]), renamed


def read_limits(model: pin.Model, base: str, notes: dict[str, str]) -> Limits:
    """Limits of a model; what is 0 in velocity or effort is taken as not given. No motor drives a floating base.

    Raises:
        BoundsError, RangeError, NotFiniteError: the description has a lower limit above the upper one, a
            negative limit, one in one direction only, or NaN.
    """
    nv = int(model.nv)
    lower, upper = np.full(nv, -np.inf), np.full(nv, np.inf)
    for j in range(1, model.njoints):
        n, start = int(model.nvs[j]), int(model.idx_qs[j])
        ends = (finite_or_unlimited(bound)[start:] for bound in (model.lowerPositionLimit, model.upperPositionLimit))
        low, high = (bound[: model.nqs[j]] for bound in ends)
        if model.nqs[j] == n:
            to = int(model.idx_vs[j])
            lower[to : to + n], upper[to : to + n] = low, high
            if (low > high).any():
                raise BoundsError("limits.position_lower", (low, high), f"above position_upper at {model.names[j]}")
            continue
        # Pinocchio writes 1.01 for the numbers of a turn, some of its readers for those of a shift, too
        turns = {7: 4, 4: 2 if n == 3 and "Planar" in model.joints[j].shortname() else 4}.get(len(low), len(low))
        none = np.where(np.arange(len(low)) < len(low) - turns, np.inf, 1.0)
        tight = ((low > -none) & (low != -PIN_UNIT)) | ((high < none) & (high != PIN_UNIT))
        if tight.any():
            shown = "; ".join(f"{low[k]:g} to {high[k]:g}" for k in np.flatnonzero(tight))
            log.warning(
                "%s: position limits of a joint without single coordinates are not kept: %s", model.names[j], shown
            )
    names = [str(model.names[j]) for j in range(1, model.njoints) for _ in range(int(model.nvs[j]))]
    rates = {}
    for key, bounds in (
        ("velocity", (model.lowerVelocityLimit, model.upperVelocityLimit)),
        ("effort", (model.lowerEffortLimit, model.upperEffortLimit)),
    ):
        rates[key] = array = _both_ways(key, names, *(finite_or_unlimited(bound) for bound in bounds))
        if base == "floating" and key == "effort":
            if (array[:6] > 0.0).any() and np.isfinite(array[:6]).any():
                log.warning("%s floats: its efforts of at most %s N, N m are those of no motor", names[0], array[:6])
            array[:6] = np.inf
        absent = dict.fromkeys(name for name, value in zip(names, array, strict=True) if value == 0.0)
        array[array == 0.0] = np.inf
        if absent:
            text = f"not given for {', '.join(absent)}: unlimited"
            notes[key] = f"{notes[key]}; {text}" if key in notes else text
    return Limits(lower, upper, rates["velocity"], np.full(nv, np.inf), rates["effort"])


def _both_ways(key: str, names: list[str], lower: Array, upper: Array) -> Array:
    """The largest size that a velocity or effort may have in both directions; a lower one that says more is said."""
    out, uneven = np.array(upper), []
    for k, (low, high) in enumerate(zip(lower, upper, strict=True)):
        if (low > 0.0 and (key == "velocity" or low == high)) or (high == 0.0 and np.isinf(low)):
            # Pinocchio 4.1 has the largest velocity, and its sample models the effort, as the lower one too, with a
            # positive sign; 0 is not given
            low = -high
        if high < 0.0 or ((high > 0.0) != (low < 0.0) and not np.isnan(low + high)):
            raise RangeError(f"limits.{key}", (low, high), f"{names[k]}: expected one below and one above 0")
        out[k] = np.minimum(-low, high)
        if low != -high and np.isfinite([low, high]).all():
            uneven.append(f"{low:g} to {high:g} of {names[k]}")
    if uneven:
        log.warning("the lesser of both directions limits %s: %s", key, "; ".join(uneven))
    return out


def override_limits(robot: Robot, changes: Mapping[str, Any]) -> Robot:
    """A copy with the limits that are not None replaced, said in the notes."""
    given = {key: value for key, value in changes.items() if value is not None}
    if not given:
        return robot
    limited = robot.with_limits(**given)
    notes = dict(limited.notes)
    for key in given:
        words = key.split("_")[0]
        notes[words] = f"{key} given by the caller" if words == "position" else "given by the caller"
    return changed(limited, notes=notes)
