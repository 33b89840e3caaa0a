"""Mechanisms with closed loops as MJCF: five that are named, and random linkages from seeds."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from wbc.robot import Robot
from wbc.validation import Array

#: What every mechanism begins with; angles are radians
HEAD = '<mujoco model="{name}"><compiler angle="radian"/><option gravity="0 0 0"/><worldbody>{bodies}</worldbody>'
INERTIA = '<inertial pos="0 0 0" mass="1" diaginertia="0.01 0.01 0.01"/>'


def numbers(values: Array) -> str:
    """Numbers as an attribute has them, to the last bit."""
    return " ".join(repr(float(value)) for value in np.ravel(values))


def mjcf(name: str, bodies: str, equalities: str) -> str:
    """The text of a mechanism."""
    return HEAD.format(name=name, bodies=bodies) + f"<equality>{equalities}</equality></mujoco>"


def body(name: str, position: Array, joints: str, inner: str = "") -> str:
    """A link with its joints and what it carries."""
    return f'<body name="{name}" pos="{numbers(position)}">{joints}{INERTIA}{inner}</body>'


def hinge(name: str, axis: Array) -> str:
    """A hinge at the link's origin."""
    return f'<joint name="{name}" axis="{numbers(axis)}"/>'


def within(robot: Robot, room: float) -> Robot:
    """With positions no further than a room from neutral, nor beyond the file's limits."""
    index, low, high = robot.position_index, robot.limits.position_lower.copy(), robot.limits.position_upper.copy()
    has = index >= 0
    low[has] = np.maximum(low[has], robot.neutral[index[has]] - room)
    high[has] = np.minimum(high[has], robot.neutral[index[has]] + room)
    return robot.with_limits(position_lower=low, position_upper=high)


def four_bar() -> str:
    """A crank, a coupler and a rocker of unequal lengths in the plane of x and z."""
    y = np.array([0.0, 1.0, 0.0])
    coupler = body("coupler", np.array([0.0, 0.0, 0.2]), hinge("knee", y))
    crank = body("crank", np.zeros(3), hinge("motor", y), coupler)
    rocker = body("rocker", np.array([0.5, 0.0, 0.0]), hinge("heel", y))
    return mjcf("four_bar", crank + rocker, '<connect name="pin" body1="coupler" body2="rocker" anchor="0.45 0 0.1"/>')


def ankle() -> str:
    """Two motors with rods to a foot that pitches and rolls, as humanoids have."""
    x, y = np.array([1.0, 0.0, 0.0]), np.array([0.0, 1.0, 0.0])
    foot = body("foot", np.array([0.0, 0.0, -0.3]), hinge("pitch", y) + hinge("roll", x))
    rods, loops = "", ""
    for side, sign in (("left", 1.0), ("right", -1.0)):
        rod = body(f"{side}_rod", np.array([-0.05, 0.0, 0.0]), f'<joint name="{side}_ball" type="ball"/>')
        rods += body(f"{side}_crank", np.array([0.0, 0.04 * sign, -0.05]), hinge(f"{side}_motor", y), rod)
        loops += f'<connect name="{side}" body1="{side}_rod" body2="foot" anchor="0 0 -0.25"/>'
    return mjcf("ankle", foot + rods, loops)


def delta() -> str:
    """Three arms of a crank and a rod with ball joints at its ends, and a plate that only moves along three axes."""
    axes = "".join(f'<joint name="{name}" type="slide" axis="{axis}"/>' for name, axis in zip("xyz", AXES, strict=True))
    bodies, loops = body("plate", np.array([0.0, 0.0, -0.35]), axes), ""
    for k in range(3):
        angle = 2.0 * np.pi * k / 3.0
        out, across = np.array([np.cos(angle), np.sin(angle), 0.0]), np.array([-np.sin(angle), np.cos(angle), 0.0])
        rod = body(f"rod{k}", 0.15 * out, f'<joint name="ball{k}" type="ball"/>')
        bodies += body(f"crank{k}", 0.1 * out, hinge(f"motor{k}", across), rod)
        end = np.array([0.0, 0.0, -0.35]) + 0.05 * out - 0.25 * out
        loops += f'<connect name="arm{k}" body1="rod{k}" body2="plate" anchor="{numbers(end)}"/>'
    return mjcf("delta", bodies, loops)


AXES = ("1 0 0", "0 1 0", "0 0 1")


def gripper() -> str:
    """Two four-bars, mirrored; the second motor follows the first."""
    y, bodies, loops = np.array([0.0, 1.0, 0.0]), "", ""
    for side, sign in (("left", 1.0), ("right", -1.0)):
        finger = body(f"{side}_finger", np.array([0.03 * sign, 0.0, 0.05]), hinge(f"{side}_knuckle", sign * y))
        bodies += body(f"{side}_crank", np.array([0.01 * sign, 0.0, 0.0]), hinge(f"{side}_motor", sign * y), finger)
        bodies += body(f"{side}_link", np.array([0.025 * sign, 0.0, 0.0]), hinge(f"{side}_spring", sign * y))
        anchor = numbers(np.array([0.012 * sign, 0.0, -0.004]))
        loops += f'<connect name="{side}" body1="{side}_finger" body2="{side}_link" anchor="{anchor}"/>'
    loops += '<joint name="both" joint1="right_motor" joint2="left_motor" polycoef="0 1 0.1 0 0"/>'
    return mjcf("gripper", bodies, loops)


def jansen() -> str:
    """A walking leg: a crank, two rods, and two chains from a fixed pivot that meet in the foot."""
    y = np.array([0.0, 1.0, 0.0])
    places = {"crank": (0.15, 0.0), "pivot": (-0.38, -0.078), "top": (-0.25, 0.3), "back": (-0.75, 0.1)}
    places |= {"low": (-0.2, -0.45), "foot": (-0.65, -0.3)}
    at = {name: np.array([x, 0.0, z]) for name, (x, z) in places.items()}
    rods = "".join(body(f"{name}_rod", at["crank"], hinge(f"{name}_rod_joint", y)) for name in ("top", "low"))
    crank = body("crank", np.zeros(3), hinge("motor", y), rods)
    coupler = body("coupler", at["back"] - at["pivot"], hinge("coupler_joint", y))
    leg = body("leg", at["low"] - at["pivot"], hinge("leg_joint", y))
    upper = body("upper", at["pivot"], hinge("upper_joint", y), coupler)
    lower = body("lower", at["pivot"], hinge("lower_joint", y), leg)
    meets = (
        ("top", "top_rod", "upper", "crank"),
        ("low", "low_rod", "lower", "crank"),
        ("foot", "coupler", "leg", "back"),
    )
    loops = "".join(
        f'<connect name="{name}" body1="{one}" body2="{other}" anchor="{numbers(at[name] - at[of])}"/>'
        for name, one, other, of in meets
    )
    return mjcf("jansen", crank + upper + lower, loops)


def parallelogram() -> str:
    """Three equal cranks under one coupler: each loop is there twice, and all lie flat where the cranks do."""
    y, x = np.array([0.0, 1.0, 0.0]), np.array([0.3, 0.0, 0.0])
    bodies = body(
        "crank0", np.zeros(3), hinge("joint0", y), body("coupler", np.array([0.0, 0.0, 0.3]), hinge("tilt", y))
    )
    bodies += "".join(body(f"crank{k}", k * x, hinge(f"joint{k}", y)) for k in (1, 2))
    loops = "".join(
        f'<connect name="loop{k}" body1="coupler" body2="crank{k}" anchor="{numbers(k * x)}"/>' for k in (1, 2)
    )
    return mjcf("parallelogram", bodies, loops)


#: Name -> text
NAMED: Mapping[str, str] = {make.__name__: make() for make in (four_bar, ankle, gripper, delta, jansen, parallelogram)}


def random_linkage(seed: int) -> str:
    """Of 4 to 12 bars, planar or spatial: two or three chains from the ground whose last links meet."""
    rng = np.random.default_rng(seed)
    planar, chains = bool(rng.random() < 0.5), int(rng.integers(2, 4))
    count = int(rng.integers(max(3, 2 * chains), 12))
    links = [count // chains + (k < count % chains) for k in range(chains)]
    kind = "connect" if planar or rng.random() < 0.6 else "weld"
    if kind == "weld":
        # Six rows a loop leave something to move
        chains, links = 2, [4, 4 + int(rng.integers(0, 3))]
    bodies, ends = "", []
    for c, n in enumerate(links):
        inner = ""
        base = rng.uniform(-0.5, 0.5, 3)
        steps = [rng.uniform(-0.4, 0.4, 3) for _ in range(n)]
        axes = [_axis(rng, planar) for _ in range(n)]
        if planar:
            base[1] = 0.0
            for step in steps:
                step[1] = 0.0
        for k in reversed(range(n)):
            inner = body(f"link{c}_{k}", base if k == 0 else steps[k - 1], hinge(f"joint{c}_{k}", axes[k]), inner)
        bodies += inner
        ends.append((f"link{c}_{n - 1}", base + np.sum(steps[: n - 1], axis=0)))
    meets = ends[0][1] + rng.uniform(-0.3, 0.3, 3) * ([1, 0, 1] if planar else [1, 1, 1])
    loops = ""
    for c in range(1, chains):
        anchor = meets - ends[0][1] if kind == "connect" else meets - ends[c][1]
        loops += f'<{kind} name="loop{c}" body1="{ends[0][0]}" body2="{ends[c][0]}" anchor="{numbers(anchor)}"/>'
    return mjcf(f"linkage{seed}", bodies, loops)


def _axis(rng: np.random.Generator, planar: bool) -> Array:
    axis = np.array([0.0, rng.choice([-1.0, 1.0]), 0.0]) if planar else rng.normal(size=3)
    return axis / np.linalg.norm(axis)


#: Joints of the named mechanisms that motors drive: as many as they have motions, rods that turn about themselves aside
MOTORS: Mapping[str, tuple[str, ...]] = {
    "four_bar": ("motor",),
    "ankle": ("left_motor", "right_motor"),
    "gripper": ("left_motor",),
    "delta": ("motor0", "motor1", "motor2"),
    "jansen": ("motor",),
    "parallelogram": ("joint0",),
    "bennett": ("joint0",),
    "sarrus": ("joint0",),
    "desk_lamp": ("shoulder", "elbow"),
    "hoekens": ("motor",),
    "pantograph": ("main_joint", "inner_joint"),
}


def with_motors(text: str, motors: Sequence[str]) -> str:
    """A mechanism that weighs, with motors at some joints."""
    made = "".join(f'<motor joint="{name}"/>' for name in motors)
    return text.replace('gravity="0 0 0"', 'gravity="0 0 -9.81"').replace(
        "</mujoco>", f"<actuator>{made}</actuator></mujoco>"
    )


def ring(name: str, points: Sequence[Array], axes: Sequence[Array]) -> str:
    """One chain of hinges from the ground to the ground; the last hinge is two places on its axis, as files have it."""
    inner, last = "", len(points) - 2
    for k in reversed(range(last + 1)):
        inner = body(f"link{k}", points[k] - (points[k - 1] if k else 0.0), hinge(f"joint{k}", axes[k]), inner)
    ends = (points[-1], points[-1] + 0.1 * axes[-1])
    loops = (
        f'<connect name="end{n}" body1="link{last}" anchor="{numbers(end - points[last])}"/>'
        for n, end in enumerate(ends)
    )
    return mjcf(name, inner, "".join(loops))


def bennett(twist: float = 0.7, other: float = 1.3, length: float = 0.3, first: float = 1.2) -> str:
    """Four bars whose axes are skew, which move as sin(twist) / length is the same of neighbours."""
    lengths = (length, length * np.sin(other) / np.sin(twist))
    second = 2.0 * np.arctan2(np.sin(0.5 * (other + twist)), np.sin(0.5 * (other - twist)) * np.tan(0.5 * first))
    place, turn, points, axes = np.zeros(3), np.eye(3), list[Array](), list[Array]()
    for k, angle in enumerate((first, second, -first, -second)):
        points.append(place)
        axes.append(turn[:, 2])
        c, s, a, b = np.cos(angle), np.sin(angle), np.cos((twist, other)[k % 2]), np.sin((twist, other)[k % 2])
        turn = turn @ np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
        place = place + lengths[k % 2] * turn[:, 0]
        turn = turn @ np.array([[1.0, 0.0, 0.0], [0.0, a, -b], [0.0, b, a]])
    return ring("bennett", points, axes)


def sarrus() -> str:
    """Two pairs of plates at right angles that lift a table straight up."""
    sides = [np.array([0.0, 1.0, 0.0]), np.array([1.0, 0.0, 0.0])]
    points = [out * side + height * np.array([0.0, 0.0, 1.0]) for side in sides for out, height in FOLD]
    points[3:] = points[:2:-1]
    return ring("sarrus", points, [np.array([1.0, 0.0, 0.0])] * 3 + [np.array([0.0, 1.0, 0.0])] * 3)


#: How far out and how high the three hinges of each of Sarrus' pairs are [m]
FOLD = ((0.3, 0.0), (0.45, 0.2), (0.3, 0.4))


def desk_lamp() -> str:
    """Two parallelograms, one on the other."""
    y, aside = np.array([0.0, 1.0, 0.0]), np.array([0.1, 0.0, 0.0])
    up, out = np.array([0.1, 0.0, 0.3]), np.array([0.25, 0.0, 0.1])
    head = body("head", out, hinge("head_joint", y))
    upper = body("arm1", np.zeros(3), hinge("elbow", y), head) + body("rod1", aside, hinge("rod1_joint", y))
    plate = body("plate", up, hinge("plate_joint", y), upper)
    bodies = body("arm0", np.zeros(3), hinge("shoulder", y), plate) + body("rod0", aside, hinge("rod0_joint", y))
    loops = (
        f'<connect name="{name}" body1="{one}" body2="{other}" anchor="{numbers(aside)}"/>'
        for name, one, other in (("lower", "plate", "rod0"), ("upper", "head", "rod1"))
    )
    return mjcf("desk_lamp", bodies, "".join(loops))


def hoekens() -> str:
    """A crank and a rocker whose coupler goes straight for half a turn."""
    y, unit = np.array([0.0, 1.0, 0.0]), 0.1
    crank_end, heel = np.array([0.0, 0.0, unit]), np.array([2.0 * unit, 0.0, 0.0])
    gap = heel - crank_end
    middle = crank_end + 0.5 * gap
    aside = np.array([-gap[2], 0.0, gap[0]]) / np.linalg.norm(gap)
    pin = middle + aside * np.sqrt((2.5 * unit) ** 2 - 0.25 * gap @ gap)
    crank = body("crank", np.zeros(3), hinge("motor", y), body("coupler", crank_end, hinge("knee", y)))
    rocker = body("rocker", heel, hinge("heel", y))
    anchor = numbers(pin - crank_end)
    return mjcf("hoekens", crank + rocker, f'<connect name="pin" body1="coupler" body2="rocker" anchor="{anchor}"/>')


def pantograph() -> str:
    """Four bars in a parallelogram, two of them longer than it."""
    y, arm, other = np.array([0.0, 1.0, 0.0]), np.array([0.1, 0.0, 0.2]), np.array([0.1, 0.0, -0.2])
    tip = body("tip", 2.0 * arm, hinge("tip_joint", y))
    inner = body("inner", arm, hinge("inner_joint", y), body("cross", other, hinge("cross_joint", y)))
    bodies = body("main", np.zeros(3), hinge("main_joint", y), tip + inner)
    return mjcf("pantograph", bodies, f'<connect name="cross" body1="cross" body2="tip" anchor="{numbers(arm)}"/>')


#: Name -> text of those that move as their lengths are special; their rows depend on each other where they are closed
SPECIAL: Mapping[str, str] = {make.__name__: make() for make in (bennett, sarrus, desk_lamp, hoekens, pantograph)}
