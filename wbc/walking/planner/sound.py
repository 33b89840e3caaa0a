"""Plans whose swings can be carried out: each is computed once more as it will be, while the body moves."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import zip_longest

from wbc.walking.planner.eased import eased_slices
from wbc.walking.planner.proof import Proof
from wbc.walking.planner.slices import Slices
from wbc.walking.planner.stances.body import BodySearch
from wbc.walking.planner.stances.nodes import Found
from wbc.walking.planner.swings.law import SwingLaw, law_of
from wbc.walking.planner.swings.move import Move

#: Searches again, each without a swing that turned out to be impossible or slower by more than the margins allow
AGAIN = 40
#: Slices of work that the proofs of one move count as
PROOFS = 2.0


def sound_slices(
    search: BodySearch, starts: Sequence[Sequence[int]], sample: int = 0, deadline: float | None = None
) -> Slices[tuple[Found, tuple[SwingLaw, ...]]]:
    """As :meth:`StanceSearch.slices`, and the laws of the moves.

    The search has swings at fewer points, and with the body where a faster swing would have it. One that is not
    possible as it would be carried out is refused, of one that is slower the time is corrected, and the search made
    again; what was computed is kept. So is one that touches something on its way, or by the stance that it leads to
    (:mod:`wbc.walking.planner.proof`). After :data:`AGAIN` of them only the moves before the last such one are left.
    Hands that have time to spare take it (:mod:`wbc.walking.planner.eased`).
    """
    laws, known = list[SwingLaw](), dict[Move, SwingLaw]()
    proof = Proof(search.swings)
    for _ in range(AGAIN):
        found = yield from search.slices(starts, sample, deadline)
        laws, key, at = [], list(found.start), sample
        if proof.of_stance(key, at, found.moves[0].lift if found.moves else found.reached) and len(starts) > 1:
            starts = [start for start in starts if tuple(start) != found.start]
            continue
        for move, following in zip_longest(found.moves, found.moves[1:]):
            law = known.get(move)
            if law is None:
                yield None
                law = known[move] = law_of(search.swings, move)
            planned = max(move.duration, 0.0 if move.delay else (move.land - move.lift) * search.path.spacing)
            needed = law.duration + search.swings.extra
            if not law.possible or needed > planned + search.walker.margins.slower:
                search.correct(move, needed, law.possible)
                break
            if search.allowance is not None:
                search.allowance.left -= PROOFS
            if proof.of_swing(move, law, key):
                search.correct(move, needed, False)
                break
            key[move.arm], at = move.target, move.land
            if proof.of_stance(key, at, following.lift if following else found.reached):
                search.exclude(move)
                break
            laws.append(law)
        else:
            return (yield from eased_slices(search, found, laws, sample, proof))
    return (yield from eased_slices(search, search.shortened(found, len(laws)), laws, sample, proof))
