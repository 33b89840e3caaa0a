"""Random MJCF texts that draw what the schema has to move, turn, weigh, limit, drive and couple."""

from __future__ import annotations

import numpy as np

PRIMITIVES = ("sphere", "capsule", "ellipsoid", "cylinder", "box")
INERTIAS = ("legacy", "exact", "convex", "shell")


class RandomMjcf:
    """One text. Names of bodies, joints and sites are drawn from the same few, and are often missing."""

    def __init__(self, seed: int) -> None:
        self.rng = np.random.default_rng(seed)
        self.radians = self.chance(0.5)
        self.explicit = self.chance(0.15)  # autolimits="false"
        self.inertials = self.chance(0.1)  # inertiafromgeom="false"
        self.lines = self.chance(0.5)  # geoms and sites from point to point, where no class gives a place
        self.meshes = int(self.rng.integers(0, 3))
        self.used: dict[str, set[str]] = {kind: set() for kind in ("body", "joint", "site", "geom")}
        self.copied = 0
        self.scalars: list[str] = []
        self.balls: list[str] = []
        self.bodies: list[str] = []

    def chance(self, p: float) -> bool:
        return bool(self.rng.random() < p)

    def pick(self, *choices: str) -> str:
        return str(self.rng.choice(choices))

    def numbers(self, count: int, low: float = -1.0, high: float = 1.0) -> str:
        return " ".join(f"{x:.5g}" for x in self.rng.uniform(low, high, count))

    def maybe(self, p: float, key: str, value: str) -> str:
        return f' {key}="{value}"' if self.chance(p) else ""

    def angle(self, low: float, high: float) -> str:
        unit = 1.0 if self.radians else 180.0 / np.pi
        return " ".join(f"{unit * x:.5g}" for x in sorted(self.rng.uniform(low, high, 2)))

    def turn(self) -> str:
        """An orientation in one of MJCF's ways, not of unit length."""
        unit = 1.0 if self.radians else 180.0 / np.pi
        ways = {
            "quat": self.numbers(4),
            "axisangle": f"{self.numbers(3)} {self.rng.uniform(-3.0, 3.0) * unit:.5g}",
            "euler": self.numbers(3, -2.0 * unit, 2.0 * unit),
            "xyaxes": self.numbers(6),
            "zaxis": self.numbers(3),
        }
        way = self.pick(*ways, "none", "none")
        return f' {way}="{ways[way]}"' if way in ways else ""

    def name(self, kind: str) -> str:
        """A name attribute, or none; the same name may be another kind's."""
        if self.copied or self.chance(0.25):
            return ""
        name = self.pick("a", "b", "c", "d", "e", "f", "tip", "body1", "a_joint", "a_site", "universe")
        while name in self.used[kind]:
            name += self.pick("1", "2", "x", "_joint")
        self.used[kind].add(name)
        return name

    def named(self, kind: str) -> tuple[str, str]:
        name = self.name(kind)
        return name, f' name="{name}"' if name else ""

    def which(self) -> str:
        return f' class="{self.pick("main", "inner", "outer")}"' if self.chance(0.2) else ""

    # Elements

    def geom_attributes(self) -> str:
        return (
            self.maybe(0.3, "mass", f"{self.rng.uniform(0.1, 3.0):.4g}")
            + self.maybe(0.3, "density", f"{self.rng.uniform(100.0, 3000.0):.4g}")
            + self.maybe(0.2, "group", str(self.rng.integers(0, 5)))
            + (' contype="0" conaffinity="0"' if self.chance(0.2) else "")
        )

    def geom(self) -> str:
        rng, (_, label) = self.rng, self.named("geom")
        shell = self.maybe(0.15, "shellinertia", "true")
        head = f"<geom{label}{self.which()}{self.geom_attributes()}"
        place = self.maybe(0.6, "pos", self.numbers(3, -0.3, 0.3))
        if self.meshes and self.chance(0.35):
            mesh = f' mesh="m{rng.integers(self.meshes)}"'
            kind = self.pick("mesh", "mesh", *PRIMITIVES)
            scale = "" if kind == "mesh" else self.maybe(0.3, "fitscale", f"{rng.uniform(0.5, 1.5):.4g}")
            return f'{head} type="{kind}"{mesh}{scale}{place}{self.turn()}/>'
        kind, size = self.pick(*PRIMITIVES), self.numbers(3, 0.03, 0.2)
        if self.lines and kind in PRIMITIVES[1:] and self.chance(0.3):
            return f'{head} type="{kind}" size="{size}" fromto="{self.numbers(6, -0.3, 0.3)}"{shell}/>'
        return f'{head} type="{kind}" size="{size}"{place}{self.turn()}{shell}/>'

    def joint(self, kind: str) -> str:
        rng, (name, label) = self.rng, self.named("joint")
        if kind == "free" and self.chance(0.5):
            return f"<freejoint{label}{self.maybe(0.3, 'align', self.pick('true', 'false'))}/>"
        out = f'<joint{label} type="{kind}"{self.which() if kind != "free" else ""}'
        if kind == "free":
            return f'{out} armature="0"/>'
        scalar = kind in ("hinge", "slide")
        (self.scalars if scalar else self.balls).append(name)
        axis = self.pick("1 0 0", "0 0 1", "1e-7 1 0", "0 1 -1e-9", "0 -1 0") if self.chance(0.3) else self.numbers(3)
        out += f' axis="{axis}"' + self.maybe(0.5, "pos", self.numbers(3, -0.2, 0.2))
        out += self.maybe(0.4, "armature", f"{rng.uniform(0.0, 0.5):.4g}")
        out += self.maybe(0.3, "damping", f"{rng.uniform(0.0, 2.0):.4g}")
        out += self.maybe(0.2, "frictionloss", f"{rng.uniform(0.0, 2.0):.4g}")
        out += self.maybe(0.2, "stiffness", f"{rng.uniform(0.0, 5.0):.4g}")
        if scalar:
            unit = 180.0 / np.pi if kind == "hinge" and not self.radians else 1.0
            out += self.maybe(0.4, "ref", f"{unit * rng.uniform(-0.7, 0.7):.5g}")
            out += self.maybe(0.2, "springref", f"{unit * rng.uniform(-0.7, 0.7):.5g}")
            low, high = sorted((unit * rng.uniform(-2.5, 2.5, 2)).tolist())
            if self.chance(0.1):
                out += ' range="0 0"' + (' limited="false"' if self.explicit else "")
            elif self.chance(0.6):
                limited = self.pick("true", "false") if self.explicit or self.chance(0.3) else "auto"
                out += f' range="{low:.5g} {high:.5g}" limited="{limited}"'
            if self.chance(0.2):
                out += f' actuatorfrcrange="{-rng.uniform(0, 20):.4g} {rng.uniform(0.1, 20):.4g}"'
                out += ' actuatorfrclimited="true"' if self.explicit else ""
        else:  # a class may have a range for hinges
            limited = self.pick("true", "false")
            out += f' range="0 {0.9 if self.radians else 50}" limited="{limited}"'
        return out + "/>"

    def site(self) -> str:
        _, label = self.named("site")
        head = f"<site{label}{self.which()}"
        if self.lines and self.chance(0.3):
            return f'{head} type="{self.pick("capsule", "box")}" size=".01" fromto="{self.numbers(6, -0.3, 0.3)}"/>'
        return f"{head}{self.maybe(0.7, 'pos', self.numbers(3, -0.3, 0.3))}{self.turn()}/>"

    def inertial(self) -> str:
        out = f'<inertial pos="{self.numbers(3, -0.2, 0.2)}" mass="{self.rng.uniform(0.1, 4.0):.4g}"'
        if self.chance(0.4):
            root = self.rng.normal(size=(3, 3))
            i = root @ root.T * 0.02
            i = np.trace(i) * np.eye(3) - i
            return out + f' fullinertia="{" ".join(f"{x:.8g}" for x in i[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]])}"/>'
        return out + f'{self.turn()} diaginertia="{self.numbers(3, 0.05, 0.09)}"/>'

    def body(self, depth: int, *, top: bool = False, bare: bool = False) -> str:
        rng, (name, label) = self.rng, self.named("body")
        if name:
            self.bodies.append(name)
        joints = ""
        if not bare:
            if top and self.chance(0.25):
                joints = self.joint("free")
            elif self.chance(0.1):
                joints = self.joint("ball")
            elif not self.chance(0.15):
                joints = "".join(self.joint(self.pick("hinge", "hinge", "slide")) for _ in range(rng.integers(1, 4)))
        parts = [self.geom() for _ in range(rng.integers(1, 3))] + [self.site() for _ in range(rng.integers(0, 3))]
        if self.inertials or self.chance(0.15):
            parts.append(self.inertial())
        inner = [self.body(depth - 1) for _ in range(rng.integers(1, 3))] if depth else []
        children = self.maybe(0.2, "childclass", self.pick("main", "inner", "outer"))
        gravity = self.maybe(0.05, "gravcomp", "0.5")
        body = "".join([joints, *parts, *(self.wrapped(text) for text in inner)])
        return f"<body{label}{children}{gravity}{self.maybe(0.8, 'pos', self.numbers(3))}{self.turn()}>{body}</body>"

    def wrapped(self, text: str) -> str:
        """An element, or in a frame."""
        if not self.chance(0.25):
            return text
        children = self.maybe(0.3, "childclass", self.pick("main", "inner", "outer"))
        return f"<frame{children}{self.maybe(0.8, 'pos', self.numbers(3))}{self.turn()}>{text}</frame>"

    def world(self) -> str:
        rng = self.rng
        out = "".join(self.wrapped(self.body(int(rng.integers(1, 4)), top=True)) for _ in range(rng.integers(1, 3)))
        if self.chance(0.3):
            self.copied += 1
            copies = f"<body>{self.joint('hinge')}{self.geom()}{self.inertial() if self.inertials else ''}</body>"
            self.scalars.pop()
            self.copied -= 1
            out += f'<body{self.named("body")[1]}><replicate count="3" offset="{self.numbers(3)}" euler="0 0 20">'
            out += f"{copies}</replicate></body>"
        if self.chance(0.3):
            out += self.body(0, bare=True)
        if self.chance(0.3):
            out += f'<body mocap="true" pos="{self.numbers(3)}">{self.geom()}</body>'
        if self.chance(0.3):
            out += (
                f'<body pos="{self.numbers(3)}"><freejoint/><inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/></body>'
            )
        return out

    # Sections

    def compiler(self) -> str:
        rng = self.rng
        out = f' angle="{"radian" if self.radians else "degree"}" autolimits="{str(not self.explicit).lower()}"'
        axes = rng.permutation(list("xyz")) if self.chance(0.7) else rng.choice(list("xyz"), 3)
        out += self.maybe(0.5, "eulerseq", "".join(axis.upper() if self.chance(0.5) else axis for axis in axes))
        out += self.maybe(0.15, "boundmass", "0.3") + self.maybe(0.15, "boundinertia", "0.002")
        out += self.maybe(0.5, "balanceinertia", "true") + self.maybe(0.15, "settotalmass", "7")
        out += self.maybe(0.2, "inertiagrouprange", f"0 {rng.integers(3, 5)}") + self.maybe(0.3, "fitaabb", "true")
        out += self.maybe(0.2, "alignfree", "true") + self.maybe(0.15, "fusestatic", "true")
        way = "false" if self.inertials else self.pick("auto", "auto", "true")
        return f'<compiler{out}/><compiler inertiafromgeom="{way}"/>'

    def option(self) -> str:
        flags = "".join(
            self.maybe(0.06, flag, "disable")
            for flag in ("gravity", "limit", "constraint", "equality", "spring", "damper", "frictionloss", "actuation")
        )
        gravity = self.maybe(0.5, "gravity", "0 0 0" if self.chance(0.2) else self.numbers(3, -10.0, 10.0))
        air = self.maybe(0.1, "density", "1.2") + self.maybe(0.1, "viscosity", "0.1")
        return f"<option{gravity}{air}{self.maybe(0.1, 'actuatorgroupdisable', '2')}><flag{flags}/></option>"

    def defaults(self) -> str:
        def attributes() -> str:
            joint = self.maybe(0.4, "armature", f"{self.rng.uniform(0, 0.2):.4g}")
            joint += self.maybe(0.4, "pos", self.numbers(3, -0.2, 0.2)) + self.maybe(0.3, "damping", "0.3")
            joint += self.maybe(0.2, "range", "-0.8 0.5" if self.radians else "-40 30") if not self.explicit else ""
            geom, site = self.geom_attributes(), ""
            if not self.lines:
                geom += self.maybe(0.4, "pos", self.numbers(3, -0.2, 0.2)) + self.turn()
                site = self.maybe(0.4, "pos", self.numbers(3)) + self.turn()
            motor = self.maybe(0.4, "gear", self.numbers(1, -20.0, 20.0))
            motor += self.maybe(0.3, "ctrlrange", "-3 2") if not self.explicit else ""
            return (
                f"<joint{joint}/><geom{geom}/><site{site}/>"
                f"<motor{motor}/><mesh{self.maybe(0.3, 'scale', self.numbers(3, 0.5, 1.5))}/>"
                f"<equality{self.maybe(0.2, 'active', 'false')}/>"
            )

        inner = f'<default class="outer">{attributes()}<default class="inner">{attributes()}</default></default>'
        return f"<default>{attributes()}{inner}</default>"

    def assets(self) -> str:
        out = ""
        for k in range(self.meshes):
            points = self.rng.normal(size=(int(self.rng.integers(4, 12)), 3))
            points *= 0.2 / np.linalg.norm(points, axis=1, keepdims=True)
            vertices = " ".join(f"{x:.5g}" for x in points.ravel())
            out += f'<asset><mesh name="m{k}" vertex="{vertices}" inertia="{self.pick(*INERTIAS[1:])}"'
            out += self.maybe(0.4, "scale", self.numbers(3, 0.5, 2.0)) + self.maybe(0.3, "refpos", self.numbers(3))
            out += self.maybe(0.3, "refquat", self.numbers(4)) + "/></asset>"
        return out

    def equalities(self) -> str:
        out, joints = "", [name for name in self.scalars if name]
        for _ in range(self.rng.integers(0, 4)):
            active = self.maybe(0.2, "active", "false")
            if len(joints) > 1 and self.chance(0.8):
                one, two = self.rng.choice(joints, 2, replace=False)
                second = f' joint2="{two}"' if self.chance(0.9) else ""
                curve = "0 0 0" if self.chance(0.85) else self.numbers(3)
                out += f'<joint joint1="{one}"{second} polycoef="{self.numbers(2)} {curve}"{active}/>'
            elif len(self.bodies) > 1:
                one, two = self.rng.choice(self.bodies, 2, replace=False)
                point = f' anchor="{self.numbers(3)}"'
                out += f'<{self.pick("connect", "weld")} body1="{one}" body2="{two}"{point}{active}/>'
        return f"<equality>{out}</equality>"

    def tendons(self) -> str:
        joints = [name for name in self.scalars if name]
        joints = list(dict.fromkeys(joints))
        if not joints or self.copied or self.chance(0.8):
            return ""
        path = "".join(f'<joint joint="{name}" coef="{self.numbers(1)}"/>' for name in joints[:2])
        spring = (
            self.maybe(0.3, "stiffness", "3") + self.maybe(0.3, "damping", "0.4") + self.maybe(0.1, "armature", "0.1")
        )
        limit = self.maybe(0.3, "range", "-1 1") if not self.explicit else ""
        return f'<tendon><fixed name="cord"{spring}{limit}>{path}</fixed></tendon>'

    def actuators(self, cord: bool) -> str:
        rng, out = self.rng, ""
        joints = [name for name in self.scalars if name]
        for _ in range(rng.integers(0, 5) if joints else 0):
            at = f' joint{self.pick("", "inparent")}="{self.pick(*joints)}"'
            balls = [name for name in self.balls if name]
            if balls and self.chance(0.15):
                at = f' joint="{self.pick(*balls)}" gear="{self.numbers(3)}"'
            elif cord and self.chance(0.2):
                at = ' tendon="cord"'
            elif self.chance(0.5):
                at += f' gear="{self.numbers(1, -30.0, 30.0)}"'
            kind = self.pick("motor", "motor", "motor", "position", "velocity", "general", "damper", "intvelocity")
            ends = f"{-rng.uniform(0.1, 5):.4g} {rng.uniform(0.1, 5):.4g}"
            ends = "-3 3" if self.chance(0.4) else ends
            if kind == "damper":
                at += ' kv="2" ctrlrange="0 3"'
            elif kind == "intvelocity":
                at += ' kp="5" actrange="-2 2"' + (' actlimited="true"' if self.explicit else "")
            elif self.chance(0.5):
                at += f' ctrlrange="{ends}"' + (' ctrllimited="true"' if self.explicit else "")
            if self.chance(0.4):
                at += f' forcerange="{ends}"' + (' forcelimited="true"' if self.explicit else "")
            if kind == "general":
                at += f' gainprm="{self.numbers(1, 0.5, 4.0)}"'
                at += self.maybe(0.3, "dyntype", self.pick("filter", "integrator", "filterexact"))
                at += f' biastype="affine" biasprm="{self.numbers(1)}"' if self.chance(0.3) else ""
            if "ball" not in at:
                at += self.maybe(0.15, "armature", f"{rng.uniform(0, 0.05):.4g}") + self.maybe(0.1, "damping", "0.2")
            out += f"<{kind}{at}{self.which() if kind == 'motor' else ''}{self.maybe(0.2, 'group', '2')}/>"
        return f"<actuator>{out}</actuator>"

    def text(self) -> str:
        """The whole document; the world in two sections, others in any order."""
        world, more = self.world(), self.body(1, top=True) if self.chance(0.3) else ""
        tendons = self.tendons()
        sections = [self.assets(), f"<worldbody>{world}</worldbody>", f"<worldbody>{more}</worldbody>"]
        sections += [self.equalities(), tendons, self.actuators(bool(tendons)), self.compiler(), self.option()]
        order = self.rng.permutation(len(sections))
        return f"<mujoco>{self.defaults()}{''.join(sections[k] for k in order)}</mujoco>"


def random_mjcf(seed: int) -> str:
    """The text of a seed; MuJoCo refuses some."""
    return RandomMjcf(seed).text()
