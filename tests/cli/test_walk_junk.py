"""Whatever stands behind an option, it is taken or refused in one line that names it."""

from __future__ import annotations

from dataclasses import MISSING
from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings, strategies as st
from typer.testing import CliRunner

from tests.repeats import repeats
from wbc.cli import walk
from wbc.cli.app import COMMANDS, app, options_class
from wbc.cli.reading import fields_of

#: What a user may type by mistake, and what is right elsewhere
JUNK = st.sampled_from((
    "nan", "inf", "-inf", "-1", "0", "1e400", "1,2,3,4", "13,9", "13,9,nan", ",", "[]", "/", "..", "~",
    "/dev/null", "/proc/self/mem", "hold", "{}", "=", "a=b", "3-1", "hand_radius=nan", "hand_radius=1e400",
    "hand_radius=[1]", "joint_rates=[]", "acceleration_time=0", "@", "@nan", "/@nan", ".@1e9", "keyboard",
    "published", "arm", "truss_grid", "module", "L2,6", "", " ", "9" * 400, "é\u2028", "\0", "a\0b",
    "x" * 300, "hold ", "rate 1 for 2", "poses /dev/null", "1 2", "rate 0,0,0,0,0,0 for inf",
    "rate nan,0,0,0,0,0 for 1", "hand_radius=" + "[" * 4000,
))  # fmt: skip
#: Mode -> its options that take a value, and its flags
MODES = {
    mode: [(f"--{field.name}", field.kind is bool) for field in fields_of(options) if not field.said.placed]
    for mode, options in {"path": walk.WalkPath, "drive": walk.DriveWalk, "limb": walk.WalkLimb,
                          "published": walk.Published, "resume": walk.Resume}.items()
}  # fmt: skip
GIVEN = st.sampled_from(sorted(MODES)).flatmap(
    lambda mode: st.tuples(
        st.just(mode),
        st.lists(
            st.tuples(st.sampled_from([name for name, flag in MODES[mode] if not flag and name != "--out"]), JUNK),
            max_size=3,
        ),
        st.lists(st.sampled_from([name for name, flag in MODES[mode] if flag]), max_size=2),
        JUNK,
    )
)


@settings(max_examples=40, deadline=None, derandomize=True, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(given_=GIVEN)
def test_junk_is_named(given_: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    walked = list[Any]()

    def walk_instead(*arguments: Any, **_: Any) -> None:
        walked.append(arguments)
        raise SystemExit(0)

    monkeypatch.setattr("wbc.climb.session.ClimbSession.run", walk_instead)
    monkeypatch.setattr("wbc.published.three_arm_walker.on_request.perform_published", walk_instead)
    monkeypatch.chdir(tmp_path)
    mode, options, flags, first = given_
    arguments = [first] if mode in ("drive", "resume") else []
    arguments += [part for pair in options for part in pair] + flags
    done = CliRunner().invoke(app, ["walk", mode, *arguments, "--out", "run"], input="")
    assert done.exception is None or isinstance(done.exception, SystemExit), repr(done.exception)
    assert done.exit_code in (0, 2), done.output
    # What is refused leaves nothing behind
    assert bool(walked) == (done.exit_code == 0)
    # The folder is made by the walk, which is not done here
    assert not (tmp_path / "run").exists()
    if done.exit_code == 2:
        assert "rror" in done.stderr


ANY = st.sampled_from([(name, mode) for name, entry in COMMANDS.items() for mode in entry.modes])


@settings(max_examples=60 * repeats(1), deadline=None, derandomize=True)
@given(chosen=ANY, data=st.data())
def test_junk_of_any_command_is_read_or_named(chosen: tuple[str, str], data: st.DataObject) -> None:
    """As far as reading goes: what a command does with it is not done here."""
    name, mode = chosen
    options = options_class(name, mode)
    fields = list(fields_of(options))
    asked = data.draw(st.lists(st.sampled_from(fields), max_size=4, unique=True))
    arguments = list[str]()
    for field in fields:
        if field.said.placed and (field in asked or field.default is MISSING):
            arguments.append(data.draw(JUNK))
        elif field in asked:
            arguments += [f"--{field.name}", *([] if field.kind is bool else [data.draw(JUNK)])]
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(options, "run", lambda self: 0)
        done = CliRunner().invoke(app, [name, *([mode] if mode else []), *arguments])
    assert done.exception is None or isinstance(done.exception, SystemExit), repr(done.exception)
    assert done.exit_code in (0, 2), done.output
    assert (done.exit_code == 2) == ("rror" in done.stderr), done.stderr
