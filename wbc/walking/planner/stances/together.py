"""One grip an arm, every two of which go together: found arm by arm, so that six arms are no more than many grips."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

#: Partial choices that are looked at
STEPS = 100_000


def together(
    choices: Sequence[Sequence[int]], fit: Callable[[int, int], bool], steps: int = STEPS
) -> Iterator[tuple[int, ...]]:
    """One of each of some choices, in the order of :func:`itertools.product`; of more than ``steps`` partial ones the
    rest is left out.

    Args:
        fit: whether two of different choices go together; asked once of each two.
    """
    known = dict[tuple[int, int], bool]()
    left = steps

    def chosen(some: tuple[int, ...]) -> Iterator[tuple[int, ...]]:
        nonlocal left
        if len(some) == len(choices):
            yield some
            return
        for one in choices[len(some)]:
            left -= 1
            if left < 0:
                return
            for other in some:
                pair = other, one
                if pair not in known:
                    known[pair] = fit(*pair)
                if not known[pair]:
                    break
            else:
                yield from chosen((*some, one))

    yield from chosen(())
