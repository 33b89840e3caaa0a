"""A climb's folder: log, check, figures and page first, then what is drawn of it."""

from __future__ import annotations

import json
import pathlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from typing import Any

import wbc.log
from wbc.climb.checker import ClimbReport
from wbc.climb.loop import ClimbOutcome, ClimbRun
from wbc.climb.loop.limb_state import Cause
from wbc.climb.report.figures import climb_figures
from wbc.climb.report.plots import PLOTS, save_plots
from wbc.extras import MissingPackageError, require
from wbc.track import page
from wbc.track.page import RunPage
from wbc.track.summary import Figure

#: Figures of a run, as plain data
FIGURES = "figures.json"
#: A page that plays the climb
REPLAY = "replay.html"
#: What is drawn into the folder, in the order of the report
DRAWN = ("climb.png", "climb.mp4", "climb.gif", *(f"{name}.png" for name in PLOTS), "reach.png", "still_*.png")
#: Files of a folder, or patterns of them
WRITTEN = ("log.npz", "check.txt", FIGURES, *DRAWN, REPLAY, page.FILE)
#: Changes of a limb's state that no plan has
UNPLANNED = (Cause.HOLD_LOST, Cause.LIMB_FAILED)
#: Told what is drawn, and the share of it that is done, None where that is not known
Progress = Callable[[str, float | None], None]


def write(
    run: ClimbRun,
    report: ClimbReport | None,
    about: Mapping[str, Any],
    folder: pathlib.Path,
    pictures: bool = True,
    progress: Progress | None = None,
    *,
    stop: Callable[[], bool] | None = None,
    replay: Callable[[ClimbRun, pathlib.Path], pathlib.Path] | None = None,
) -> list[pathlib.Path]:
    """Write the files of a climb; returns them. After each of them the folder can be read.

    Args:
        run: what was done. report: its check, None: there was none.
        about: as of :func:`wbc.climb.report.climb_figures`.
        folder: is there. pictures: whether plots, pictures and a film are drawn, as far as their packages are there.
        stop: asked between pictures; true keeps what is there. replay: writes a page that plays the run into a file,
            as :func:`wbc.viewer.walks.save_climb_page`.

    Raises:
        LogFileError: the log cannot be written.
    """
    told, asked = progress or (lambda what, share: None), stop or (lambda: False)
    written = [wbc.log.save(run.log, folder, "npz")]
    if report is not None:
        written.append(folder / "check.txt")
        written[-1].write_text(f"{report}\n", encoding="utf-8")
    figures = climb_figures(run, report, about)
    written.append(folder / FIGURES)
    values = {figure.key: figure.value for figure in figures}
    written[-1].write_text(json.dumps(values, indent=1), encoding="utf-8")
    written.append(_save_page(run, report, figures, folder, []))
    missing = list[str]()
    for name, draw in _drawings(run, about, folder, told, asked, replay) if pictures and len(run.log) > 1 else ():
        if asked():
            break
        told(name, None)
        try:
            written += draw()
        except MissingPackageError as error:
            missing.append(f"{name}: {error}")
    if pictures:
        _save_page(run, report, figures, folder, missing)
    return written


def _drawings(
    run: ClimbRun, about: Mapping[str, Any], folder: pathlib.Path, told: Progress, asked: Callable[[], bool],
    replay: Callable[[ClimbRun, pathlib.Path], pathlib.Path] | None,
) -> Iterator[tuple[str, Callable[[], list[pathlib.Path]]]]:  # fmt: skip
    """What is drawn, one after the other: (name, draws it and returns its files)."""
    yield "plots", lambda: save_plots(run, folder, about)
    try:
        require("plots", "a picture")
        from wbc.climb.report import pictures, reach_map
    except MissingPackageError:
        # The plots have said so
        pass
    else:
        drawn = pictures.ClimbPictures(run)
        yield "overview", lambda: [drawn.overview(folder / pictures.OVERVIEW)]
        yield "reach", lambda: [reach_map.save_reach_map(run, folder / "reach.png")]
        swings = drawn.swings()
        chosen = sorted({swings[k * (len(swings) - 1) // max(pictures.STILLS - 1, 1)] for k in range(pictures.STILLS)})
        for number, row in enumerate(chosen, start=1):
            yield "stills", partial(drawn.still, row, folder / f"still_{number}.png")
        film = folder / "climb.mp4"
        yield "film", lambda: pictures.save_film(run, film, lambda share: told("film", share), asked)
    if replay is not None:
        yield "replay", lambda: [replay(run, folder / REPLAY)]


def _save_page(
    run: ClimbRun, report: ClimbReport | None, figures: Sequence[Figure], folder: pathlib.Path, missing: Sequence[str]
) -> pathlib.Path:
    """``report.html``: what was asked for, whether it was kept, and the pictures of the folder."""
    climber, scene = run.plans[0].climber, run.scene
    report_page = RunPage(
        f"{climber.name} on {scene.name}", f"{len(climber.limbs)} limbs, {len(scene.footholds)} footholds"
    )
    report_page.section("Asked for, and whether it was kept")
    arrived = run.outcome is ClimbOutcome.ARRIVED
    report_page.verdict(arrived, f"arrive where it was sent ({run.outcome}{f': {run.reason}' if run.reason else ''})")
    if report is None:
        report_page.text("The climb was not checked.")
    else:
        report_page.verdict(report.clean, "keep every rule of the checker, which shares no code with planner and loop")
        report_page.verbatim(str(report))
    report_page.section("Figures")
    report_page.figures(figures)
    if len(run.log) > 1:
        report_page.section("Ticks whose rows did not all hold")
        report_page.strips(run.log["t"], {"not all rows held": ~run.log["kept"].astype(bool)})
    happened = [(time, f"{limb}: {cause}") for time, limb, _, cause in run.changes if cause in UNPLANNED]
    happened = sorted([*happened, *run.noted])
    if happened:
        report_page.section("What happened")
        report_page.table((f"{time:.2f} s", text) for time, text in happened)
    report_page.section("Pictures")
    report_page.text(*missing)
    for pattern in DRAWN:
        for file in sorted(folder.glob(pattern)):
            report_page.picture(file, "film" if file.stem == "climb" and file.suffix != ".png" else "")
    report_page.section("Files")
    files = {
        REPLAY: "the climb, played in the browser without a network", FIGURES: "these figures for programs",
        "check.txt": "what the checker found", "log.npz": "every tick", "ticks.npz": "inputs of every tick",
        "climb.mp4": "a film", "climb.gif": "a film",
    }  # fmt: skip
    report_page.links(folder, files)
    return report_page.save(folder)
