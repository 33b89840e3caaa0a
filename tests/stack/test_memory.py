"""The table of a tick's memory: C, numpy and the exported header have every field in one place."""

from __future__ import annotations

import re

import pytest

from tests.stack import small
from wbc.controller import core_of
from wbc.errors import CompileError
from wbc.stack.artifact import compile_stack
from wbc.stack.layout import Layout
from wbc.stack.memory import Memory, structures
from wbc.tick.native import NativeTick


def test_fields_follow_each_other_without_a_gap() -> None:
    places = Memory(Layout(small.stack()))
    ends = [places[field.name].stop + field.spare for field in places.fields]
    assert [places[field.name].start for field in places.fields] == [0, *ends[:-1]]
    assert places["q"].start == places.report
    assert (places["H"].start, ends[-1]) == (places.state, places.size)


def test_a_field_that_was_moved_is_refused() -> None:
    """Also where the sizes of all structures are as they should be."""
    places = Memory(Layout(small.stack()))
    offsets = [8 * places[field.name].start for field in places.fields] + [-1]
    places.require(lambda k: offsets[k], "it")
    names = [field.name for field in places.fields]
    for name in ("stationarity", "use_v", "dt"):
        k = names.index(name)
        moved = [*offsets]
        moved[k], moved[k + 1] = moved[k + 1], moved[k]
        with pytest.raises(CompileError, match=f"{name} is at byte"):
            places.require(lambda n, moved=moved: moved[n], "it")
    with pytest.raises(CompileError, match="more fields"):
        places.require(lambda k: [*offsets[:-1], 8 * places.size][k], "it")


def test_a_library_of_another_layout_is_refused() -> None:
    library = compile_stack(small.stack(), "native", "0").library
    assert library is not None
    other = small.stack()
    other.add(small.stack().entries[0].item, name="one more")
    with pytest.raises(CompileError, match="was built for another layout"):
        NativeTick(library, Layout(other))


def test_both_back_ends_have_one_state() -> None:
    native, vm = (core_of(small.stack().compile(backend=backend)).tick for backend in ("native", "vm"))
    assert native.state.size == vm.state.size
    for name in ("q", "v_last", "p", "dt", "v_in", "use_v", "cap", "weight", "enabled", "bound_enabled"):
        starts = [(getattr(t, name).ctypes.data - t.state.ctypes.data, getattr(t, name).size) for t in (native, vm)]
        assert starts[0] == starts[1], name


def test_the_structure_names_every_field_once() -> None:
    layout = Layout(small.stack())
    text = structures(layout)
    found = re.findall(r"^    double (\w+)", text, re.MULTILINE)
    assert found == [field.c_name for field in Memory(layout).fields]
