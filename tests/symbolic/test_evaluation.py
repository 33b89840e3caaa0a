"""Functions of CasADi in memory that stays where it is: the values are those of a call."""

from __future__ import annotations

import pickle
import threading

import casadi as ca
import numpy as np
import pytest

from wbc.symbolic.evaluation import SingleState


def functions() -> dict[str, ca.Function]:
    x, y, none, several = ca.SX.sym("x", 3), ca.SX.sym("y"), ca.SX.sym("none", 0), ca.SX.sym("several", 2, 4)
    sparse = ca.jacobian(ca.vertcat(x[0] ** 2, x[1] * x[2], 5.0), x)
    return {
        "column": ca.Function("f", [x, y], [ca.sin(x) * y]),
        "one column, one row": ca.Function("f", [x], [ca.jacobian(x[0] * x, x[0]), x.T, x[0] * x[1]]),
        "sparse": ca.Function("f", [x], [sparse, ca.SX(2, 2), x]),
        "nothing": ca.Function("f", [x, none], [x, none]),
        "matrices": ca.Function("f", [several, y], [several.T @ several, y * several]),
        "MX": (lambda z: ca.Function("f", [z], [ca.mtimes(z, z.T)]))(ca.MX.sym("z", 3)),
    }


@pytest.mark.parametrize("name", functions())
def test_values_and_shapes_are_those_of_a_call(name: str) -> None:
    function, rng = functions()[name], np.random.default_rng(0)
    state = SingleState(function)
    again = pickle.loads(pickle.dumps(state))
    for _ in range(5):
        given = [rng.normal(size=function.size_in(k)) for k in range(function.n_in())]
        flat = [x[:, 0] if x.shape[1] == 1 else x for x in given]
        wanted = [part.full() for part in function.call(given)]
        for evaluated in (state(*flat), again(*flat)):
            assert [part.shape for part in evaluated] == [part.shape for part in wanted]
            assert all(np.array_equal(a, b) for a, b in zip(evaluated, wanted, strict=True))
        for place, values in zip(state.inputs, flat, strict=True):
            place[:] = 0.5 * values
        state.run()
        halved = [part.full() for part in function.call([0.5 * x for x in given])]
        assert all(np.array_equal(a, b) for a, b in zip(state.outputs, halved, strict=True))
        assert np.array_equal(state.output, halved[0].ravel(order="F"))


def test_an_answer_stays_as_it_is() -> None:
    x = ca.SX.sym("x", 2)
    doubled = SingleState(ca.Function("f", [x], [2.0 * x]))
    first = doubled(np.ones(2))[0]
    doubled(np.zeros(2))
    assert first.ravel().tolist() == [2.0, 2.0]


def test_other_numbers_of_inputs_or_entries_are_refused() -> None:
    x, y = ca.SX.sym("x", 3), ca.SX.sym("y", 2)
    state = SingleState(ca.Function("f", [x, y], [ca.vertcat(x, y)]))
    for given in (
        [np.zeros(3)],
        [np.zeros(3)] * 2,
        [np.zeros(4), np.zeros(2)],
        [np.zeros(3), np.zeros(2), np.zeros(1)],
    ):
        with pytest.raises(ValueError, match=r"shorter|longer|broadcast"):
            state(*given)


def test_threads_get_their_own_answers() -> None:
    x = ca.SX.sym("x", 60)
    state = SingleState(ca.Function("f", [x], [ca.jacobian(ca.sin(x) * ca.sum1(x), x)]))
    apart: list[int] = []

    def work(number: int) -> None:
        q = np.full(60, 0.1 * number)
        wanted = state(q)[0]
        apart.extend(number for _ in range(2000) if not np.array_equal(state(q)[0], wanted))

    threads = [threading.Thread(target=work, args=(k,)) for k in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert not apart
