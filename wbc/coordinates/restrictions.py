"""Written restrictions of pairs: where each must not be used, as operators read them."""

from __future__ import annotations

from wbc.coordinates.determinant_places import closed_form
from wbc.coordinates.modes import Mode, mode_pairs
from wbc.coordinates.which_parts import parts


def restriction_table(robot: str, mode: str | Mode = Mode.M1) -> str:
    """Markdown table of a mode's pairs with the conditions under which the determinant of each vanishes, exactly.

    Pairs without a closed form of use are left out. Joints are counted from 1; c34 is cos(q3 + q4). Some seconds.

    Raises:
        UnknownNameError, MissingPartError: see :func:`mode_pairs`.
    """
    machine = parts(robot).robot
    lines = ["| task and constraint | not where |", "|---|---|"]
    for pair in mode_pairs(robot, mode):
        found = closed_form(machine, pair)
        if found is not None:
            name = pair.name.replace(" | ", "; ")
            lines.append(f"| {name} | {', '.join(found.lines) or 'nowhere'} |")
    return "\n".join(lines)
