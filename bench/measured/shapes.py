"""How far fitted shapes stand out of links, and which pairs of links are kept apart."""

from __future__ import annotations

from time import perf_counter

import wbc.robots
from bench.sheet import Sheet

FITS = {"1 capsule": ("capsule", 1), "2 capsules": ("capsule", 2), "3 capsules": ("capsule", 3),
        "4 spheres": ("spheres", 4), "8 spheres": ("spheres", 8)}  # fmt: skip
ARMS = {
    "Panda": ("panda", [f"panda_link{k}" for k in range(1, 8)] + ["panda_hand"]),
    "UR5": ("ur5", ["shoulder_link", "upper_arm_link", "forearm_link"] + [f"wrist_{k}_link" for k in (1, 2, 3)]),
}
#: Robots whose pairs are searched, with the shapes that they are loaded with
SEARCHED = {"panda": None, "ur5": None, "baxter": "description", "g1": "fit", "talos": "fit"}


def parts() -> dict[str, Sheet | str]:
    """Two tables."""
    rows = []
    for label, (name, links) in ARMS.items():
        cells = []
        for kind, count in FITS.values():
            robot = wbc.robots.fit_shapes(
                wbc.robots.load(name, shapes="none"), links, kind=kind, count=count, tolerance=0.0
            )
            shapes = [shape for link in links for shape in robot.shapes.get(link, ())]
            cells.append(f"{1e3 * max(s.excess for s in shapes):.1f} mm ({len(shapes)})")
        rows.append((label, *cells))
    found = []
    for name, shapes in SEARCHED.items():
        robot = wbc.robots.load(name, **({} if shapes is None else {"shapes": shapes}))
        began = perf_counter()
        pairs = wbc.robots.find_self_pairs(robot, samples=10000)
        spent = perf_counter() - began
        found.append((f"{name}, {shapes or 'stored'}", str(len(pairs.pairs)), str(len(pairs.kept)), f"{spent:.1f}"))
    return {
        "excess": Sheet("", ("largest excess (number of shapes)", *FITS), rows),
        "pairs": Sheet("", ("robot, shapes", "pairs", "kept", "s"), found),
    }
