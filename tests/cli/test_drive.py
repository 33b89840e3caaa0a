"""``wbc drive`` as a user types it."""

from __future__ import annotations

from pathlib import Path

from typer.testing import CliRunner

from wbc.cli.app import app


def run(*arguments: str | Path) -> tuple[int, str, str]:
    """(exit code, standard output, standard error) of ``wbc drive ARGUMENTS``."""
    result = CliRunner(env={"COLUMNS": "200"}).invoke(app, ["drive", *map(str, arguments)])
    return result.exit_code, result.stdout, result.stderr


def test_a_file_of_orders(tmp_path: Path) -> None:
    orders, log = tmp_path / "orders.csv", tmp_path / "log.csv"
    orders.write_text("time,pair,r1,r2,r3,r4,r5,r6\n0,,0.02\n0.5,tip | beta,0.02\n1\n")
    at = "0.3,0.5,-0.7,1.1"
    code, out, err = run("spherical_4r", "--rates", orders, "--mode", "M4", "--at", at, "--log", log)
    assert code == 0
    assert "50 ticks: 50 solved" in out
    assert "1 changes of pairs" in out
    assert "tip | beta (changing), solved" in err
    assert len(log.read_text().splitlines()) == 51


def test_bad_input(tmp_path: Path) -> None:
    assert run("spherical_4r")[0] == 2
    assert run("spherical_4r", "--rates", tmp_path / "none.csv")[0] == 2
    code, _, err = run("spherical_4r", "--keys", "--mode", "M4")
    assert code == 2
    assert "terminal" in err
