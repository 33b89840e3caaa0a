"""Plans whose swings can be carried out: each is computed once more as it will be, while the body moves."""

from __future__ import annotations

from collections.abc import Sequence

from wbc.walking.planner.eased import eased_slices
from wbc.walking.planner.slices import Slices
from wbc.walking.planner.stances.body import BodySearch
from wbc.walking.planner.stances.nodes import Found
from wbc.walking.planner.swings.law import SwingLaw, law_of
from wbc.walking.planner.swings.move import Move

#: Searches again, each without a swing that turned out to be impossible or slower by more than the margins allow
AGAIN = 20


def sound_slices(
    search: BodySearch, starts: Sequence[Sequence[int]], sample: int = 0, deadline: float | None = None
) -> Slices[tuple[Found, tuple[SwingLaw, ...]]]:
    """As :meth:`StanceSearch.slices`, and the laws of the moves.

    The search has swings at fewer points, and with the body where a faster swing would have it. One that is not
    possible as it would be carried out is refused, of one that is slower the time is corrected, and the search made
    again; what was computed is kept. After :data:`AGAIN` of them only the moves before the last such one are left.
    Hands that have time to spare take it (:mod:`wbc.walking.planner.eased`).
    """
    laws, known = list[SwingLaw](), dict[Move, SwingLaw]()
    for _ in range(AGAIN):
        found = yield from search.slices(starts, sample, deadline)
        laws = []
        for move in found.moves:
            law = known.get(move)
            if law is None:
                yield None
                law = known[move] = law_of(search.swings, move)
            planned = max(move.duration, 0.0 if move.delay else (move.land - move.lift) * search.path.spacing)
            needed = law.duration + search.swings.extra
            if not law.possible or needed > planned + search.walker.margins.slower:
                search.correct(move, needed, law.possible)
                break
            laws.append(law)
        else:
            return (yield from eased_slices(search, found, laws, sample))
    return (yield from eased_slices(search, search.shortened(found, len(laws)), laws, sample))
