"""What one function of the rows has computed is handed to the next one, which would compute it again."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Sequence

import casadi as ca

_GIVEN = (ca.OP_INPUT, ca.OP_CONST)


def hand_over(
    first: ca.Function, second: ca.Function, place: int, name: str = "handed", others: Collection[str] = ()
) -> tuple[ca.Function, ca.Function]:
    """Two functions of the same first inputs, of which the second is evaluated after the first, at the same numbers.

    Args:
        place: the output of ``first`` that stands behind the new one. name: of this. others: inputs whose numbers are
            not the same.

    Returns:
        ``first`` with one output more, ``name`` [n]; ``second``, which takes it as its last input. Both compute by the
        same operations as before.
    """
    given_to_second = [ca.SX.sym(second.name_in(k), second.sparsity_in(k)) for k in range(second.n_in())]
    own = [
        ca.SX.sym(first.name_in(k), first.sparsity_in(k)) if first.name_in(k) in others else given_to_second[k]
        for k in range(first.n_in())
    ]
    symbols = given_to_second + [own[k] for k in range(first.n_in()) if first.name_in(k) in others]
    outputs = [first.name_out(k) for k in range(first.n_out())]
    results = ca.cse([*first.call(own), *second.call(given_to_second)])
    both = ca.Function("both", symbols, results)
    depends, ends = _graph(both)
    early = _needed([k for k, (output, _) in ends.items() if output < len(outputs)], depends)
    late = _needed(ends, depends) - early
    handed = sorted({d for k in late for d in depends[k] if d in early and both.instruction_id(d) not in _GIVEN})
    given = ca.SX.sym(name, len(handed))
    known = dict(zip(handed, ca.vertsplit(given), strict=True)) if handed else {}
    values = _evaluated(both, symbols, depends, sorted(late), known)
    expressions = both.instructions_sx()
    results.insert(place, ca.vertcat(ca.SX(0, 1), *(expressions[k] for k in handed)))
    outputs.insert(place, name)
    # The symbols of a function are its own
    early_results = ca.Function("early", both.sx_in(), results[place : place + 1]).call(symbols)
    results[place] = early_results[0]
    found = [
        ca.SX(second.sparsity_out(n), ca.vertcat(ca.SX(0, 1), *(values[k] for k, (o, _) in ends.items() if o == at)))
        for n, at in enumerate(range(first.n_out(), first.n_out() + second.n_out()))
    ]
    return (
        ca.Function(first.name(), own, ca.cse(results[: len(outputs)]), first.name_in(), outputs),
        ca.Function(second.name(), [*given_to_second, given], found, [*second.name_in(), name], second.name_out()),
    )


def _graph(function: ca.Function) -> tuple[list[tuple[int, ...]], dict[int, tuple[int, int]]]:
    """Of each instruction those that it depends on; of those that write results which output, and which entry of it."""
    depends: list[tuple[int, ...]] = []
    ends = {}
    writer: dict[int, int] = {}
    for k in range(function.n_instructions()):
        operation, to = function.instruction_id(k), function.instruction_output(k)
        depends.append(() if operation in _GIVEN else tuple(writer[place] for place in function.instruction_input(k)))
        if operation == ca.OP_OUTPUT:
            ends[k] = (to[0], to[1])
        else:
            writer[to[0]] = k
    return depends, ends


def _needed(roots: Iterable[int], depends: Sequence[Sequence[int]]) -> set[int]:
    """Instructions that these depend on, with them."""
    seen: set[int] = set()
    waiting = list(roots)
    while waiting:
        k = waiting.pop()
        if k not in seen:
            seen.add(k)
            waiting += depends[k]
    return seen


def _evaluated(
    function: ca.Function,
    symbols: Sequence[ca.SX],
    depends: Sequence[Sequence[int]],
    chosen: Iterable[int],
    known: dict[int, ca.SX],
) -> dict[int, ca.SX]:
    """Results of some instructions, which depend on each other, on inputs, constants and what is known."""
    values = dict(known)

    def value(k: int) -> ca.SX:
        if k not in values:
            if function.instruction_id(k) == ca.OP_CONST:
                values[k] = ca.SX(function.instruction_constant(k))
            else:
                which, entry = function.instruction_input(k)
                values[k] = symbols[which].nz[entry]
        return values[k]

    for k in chosen:
        operation = function.instruction_id(k)
        if operation in _GIVEN:
            continue
        operands = [value(d) for d in depends[k]]
        if operation == ca.OP_OUTPUT:
            values[k] = operands[0]
        elif len(operands) == 1:
            values[k] = ca.SX.unary(operation, *operands)
        else:
            values[k] = ca.SX.binary(operation, *operands)
    return values
