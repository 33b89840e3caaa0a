"""``python -m bench.resolvers``: a table of all methods on one drive."""

from __future__ import annotations

import argparse

from bench.resolvers.drives import DT, SECONDS, Outcome, drive, methods
from wbc.interrupts import obey_interrupts

HEAD = "| method | one resolution [us] | fastest joint [rad/s] | twist lost [m/s, rad/s] | after the return [rad] |"


def line(found: Outcome) -> str:
    """A row of the table."""
    if found.failed:
        return f"| {found.name} | failed: {found.failed} | {found.fastest:.3g} | {found.lost:.2g} | |"
    numbers = f"{found.microseconds:.0f} | {found.fastest:.3g} | {found.lost:.2g} | {found.away:.2g}"
    return f"| {found.name} | {numbers} |"


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(prog="bench.resolvers", description=__doc__)
    parser.add_argument("--seconds", type=float, default=SECONDS, help=f"one way; ticks of {DT} s")
    given = parser.parse_args()
    print(HEAD)
    print("|---" * 5 + "|")
    for name, make in methods().items():
        print(line(drive(name, make, given.seconds)), flush=True)


if __name__ == "__main__":
    obey_interrupts()
    main()
