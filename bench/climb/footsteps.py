"""``python -m bench.climb.footsteps``: processor time in which the contacts of a walk are found, in the same process.

    python -m bench.climb.footsteps --robots talos,anymal_c --scenes stairs,rubble --seeds 0,1,2

The first stance and compiled code are there; the least of some repetitions counts [ms], also in proportion to 30 moves.
"""

from __future__ import annotations

import argparse
import itertools
import time

from wbc.climb import BodyPlace, first_stance, machines, scenes
from wbc.climb.scene import size_of
from wbc.climb.search import find_stances
from wbc.errors import WbcError

#: Heads of the table
HEADS = ("robot", "scene", "seed", "moves", "contacts ms", "of 30 moves ms", "else")


def row(robot: str, scene: str, seed: int, repeats: int) -> tuple[str, ...]:
    """Of a robot on a scene drawn from a seed."""
    climber = machines.climber(robot)
    course = scenes.draw(scene, size_of(climber), seed)
    try:
        start = first_stance(climber, course.scene, scenes.placed(climber, course.start))
        goal = BodyPlace(climber.body_pose(scenes.placed(climber, course.goal)).translation)
        times = []
        for _ in range(repeats):
            begun = time.process_time()
            path = find_stances(climber, course.scene, start, goal)
            times.append(1e3 * (time.process_time() - begun))
    except WbcError as error:
        return robot, scene, str(seed), "-", "-", "-", str(error)[:100]
    contacts = [stance.contacts for stance in path.stances]
    moves = sum(a != b for one, other in itertools.pairwise(contacts) for a, b in zip(one, other, strict=True))
    return robot, scene, str(seed), str(moves), f"{min(times):.0f}", f"{min(times) * 30 / max(moves, 1):.0f}", ""


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(prog="python -m bench.climb.footsteps", description=__doc__)
    parser.add_argument("--robots", default="talos,anymal_c,hexapod", help="names with commas")
    parser.add_argument("--scenes", default="stairs,rubble", help="names with commas")
    parser.add_argument("--seeds", default="0", help="whole numbers with commas")
    parser.add_argument("--repeats", type=int, default=5)
    given = parser.parse_args()
    print(f"| {' | '.join(HEADS)} |\n|{' --- |' * len(HEADS)}")
    seeds = [int(text) for text in given.seeds.split(",")]
    for robot, scene, seed in itertools.product(given.robots.split(","), given.scenes.split(","), seeds):
        print(f"| {' | '.join(row(robot, scene, seed, given.repeats))} |", flush=True)


if __name__ == "__main__":
    main()
