"""``report.html``: what a run was asked for and what came of it, as one file that needs nothing else."""

from __future__ import annotations

import base64
import html
import pathlib
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wbc import validation
from wbc.errors import WbcError
from wbc.track.summary import Figure
from wbc.validation import Array

FILE = "report.html"
#: Width of a strip [pixels]
WIDE = 860
#: Height of a strip [pixels]
STRIP = 15
#: Height of a bar chart [pixels]
TALL = 150
#: Bars of a histogram, at most
BARS = 60
#: Strips that are shown, at most
STRIPS = 40
#: Pictures that are larger are linked, so that the page stays small [bytes]
LARGEST = 1 << 20
STYLE = """
body{font:15px/1.45 system-ui,"DejaVu Sans",sans-serif;color:#1d2733;max-width:920px;margin:24px auto;padding:0 16px}
h1{font-size:24px;margin:0 0 4px}h2{font-size:17px;margin:30px 0 8px;border-bottom:1px solid #dde2e8;padding-bottom:3px}
table{border-collapse:collapse}th{color:#66727f;font-weight:500}
td,th{padding:3px 14px 3px 0;text-align:left;vertical-align:top}
img,video{max-width:100%}svg text{font:11px system-ui,"DejaVu Sans",sans-serif;fill:#1d2733}.lead{color:#66727f}
p.kept::before{content:"kept";background:#d8f0df}p.missed::before{content:"not kept";background:#f8d3cd}
p.kept::before,p.missed::before{border-radius:8px;padding:1px 8px;margin-right:8px}
pre{background:#f6f8fa;padding:10px;overflow-x:auto;font-size:13px}
"""


class RunPage:
    """A page that grows section by section.

    Args:
        title: of the page. lead: a line below it.
    """

    def __init__(self, title: str, lead: str = "") -> None:
        self._title = title
        self._parts = [f"<h1>{_text(title)}</h1>", f'<p class="lead">{_text(lead)}</p>']

    def section(self, title: str) -> None:
        """Begin another section."""
        self._parts.append(f"<h2>{_text(title)}</h2>")

    def text(self, *lines: str) -> None:
        """A paragraph a line."""
        self._parts += [f"<p>{_text(line)}</p>" for line in lines]

    def verdict(self, kept: bool, line: str) -> None:
        """What was asked for, and whether it was kept."""
        self._parts.append(f'<p class="{"kept" if kept else "missed"}">{_text(line)}</p>')

    def verbatim(self, text: str) -> None:
        """Text with its lines and columns as they are."""
        self._parts.append(f"<pre>{_text(text)}</pre>")

    def table(self, rows: Iterable[tuple[str, str]]) -> None:
        """Names and what belongs to them."""
        cells = [(_text(a), _text(b).replace("\n", "<br>")) for a, b in rows]
        lines = [f"<tr><th>{a}</th><td>{b}</td></tr>" for a, b in cells]
        self._parts.append(f"<table>{''.join(lines)}</table>")

    def figures(self, figures: Sequence[Figure]) -> None:
        """Those of a summary that have something to say."""
        self.table((one.label, one.text) for one in figures if one.label)

    def links(self, folder: pathlib.Path, files: Mapping[str, str]) -> None:
        """Files beside the page, those that are there: name -> what it is."""
        there = [(name, what) for name, what in files.items() if (folder / name).is_file()]
        if there:
            items = "".join(
                f'<li><a href="{_text(name)}">{_text(name)}</a>: {_text(what)}</li>' for name, what in there
            )
            self._parts.append(f"<ul>{items}</ul>")

    def picture(self, file: pathlib.Path, label: str = "") -> None:
        """A PNG, JPEG, GIF or MP4, kept in the page; one that is not there, or is large, is left out or linked."""
        if not file.is_file():
            return
        content, name = file.read_bytes(), _text(label or file.stem.replace("_", " "))
        if len(content) > LARGEST:
            self._parts.append(f'<p><a href="{_text(file.name)}">{name}</a></p>')
            return
        data = base64.b64encode(content).decode()
        if file.suffix == ".mp4":
            source = f'src="data:video/mp4;base64,{data}"'
            self._parts.append(f'<p><video title="{name}" controls loop muted autoplay {source}></video></p>')
            return
        kind = {".gif": "gif", ".jpg": "jpeg"}.get(file.suffix, "png")
        self._parts.append(f'<p><img alt="{name}" src="data:image/{kind};base64,{data}"></p>')

    def histogram(self, values: Array, unit: str) -> None:
        """How often a number was how large; the last bar holds all above the 99.5th percentile."""
        numbers = np.asarray(values, dtype=float)
        if not numbers.size:
            return
        top = float(np.percentile(numbers, 99.5)) or 1.0
        counts, edges = np.histogram(np.minimum(numbers, top), bins=BARS, range=(0.0, top))
        wide, most = WIDE / BARS, max(int(counts.max()), 1)
        bars = [
            f'<rect x="{k * wide:.1f}" y="{TALL - TALL * c / most:.1f}" width="{wide - 1:.1f}" '
            f'height="{TALL * c / most:.1f}" fill="#1f5fa8"><title>{c} at {edges[k]:.3g} {unit}</title></rect>'
            for k, c in enumerate(counts)
        ]
        marks = [
            f'<text x="{WIDE * share:.0f}" y="{TALL + 15}" text-anchor="{anchor}">{top * share:.3g} {unit}</text>'
            for share, anchor in ((0.0, "start"), (0.5, "middle"), (1.0, "end"))
        ]
        self._parts.append(_svg(WIDE, TALL + 20, [*bars, *marks]))
        p50, p99, worst = (float(np.percentile(numbers, p)) for p in (50, 99, 100))
        self.text(f"Median {p50:.3g} {unit}, 99th percentile {p99:.3g} {unit}, longest {worst:.3g} {unit}.")

    def strips(self, times: Array, rows: Mapping[str, Array]) -> None:
        """What was so when: a strip a row, filled where its flag is set; the rows that were longest come first."""
        flags = {name: np.asarray(values) != 0 for name, values in rows.items()}
        chosen = sorted((name for name in flags if flags[name].any()), key=lambda name: -int(flags[name].sum()))
        if not chosen or len(times) < 2:
            self.text("Nothing.")
            return
        end, label = float(times[-1]) or 1.0, 270
        scale, drawn = (WIDE - label) / end, []
        for k, name in enumerate(chosen[:STRIPS]):
            y = k * (STRIP + 4)
            drawn.append(f'<text x="0" y="{y + 11}">{_text(name)}</text>')
            drawn.append(f'<rect x="{label}" y="{y}" width="{WIDE - label}" height="{STRIP}" fill="#eef1f4"/>')
            for first, last in stretches(flags[name]):
                begin, over = float(times[first]), float(times[min(last, len(times) - 1)])
                width = max((over - begin) * scale, 1.0)
                drawn.append(
                    f'<rect x="{label + begin * scale:.1f}" y="{y}" width="{width:.1f}" height="{STRIP}" '
                    'fill="#e07b18">'
                    f"<title>{_text(name)}: {begin:.3g} s to {over:.3g} s</title></rect>"
                )
        y = min(len(chosen), STRIPS) * (STRIP + 4) + 12
        drawn += [
            f'<text x="{label}" y="{y}">0 s</text>',
            f'<text x="{WIDE}" y="{y}" text-anchor="end">{end:.3g} s</text>',
        ]
        self._parts.append(_svg(WIDE, y + 6, drawn))
        if len(chosen) > STRIPS:
            self.text(f"And {len(chosen) - STRIPS} more, for shorter.")

    def save(self, folder: pathlib.Path) -> pathlib.Path:
        """Write ``report.html``; returns the file.

        Raises:
            WbcError: it cannot be written.
        """
        page = f'<!doctype html><html lang="en"><head><meta charset="utf-8"><title>{_text(self._title)}</title>'
        page += f"<style>{STYLE}</style></head><body>{''.join(self._parts)}</body></html>\n"
        file = folder / FILE
        with validation.writing("report", file, WbcError):
            file.write_text(page, encoding="utf-8")
        return file


def stretches(flags: NDArray[Any]) -> list[tuple[int, int]]:
    """(first, one after the last) of every stretch of set flags."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], np.asarray(flags, dtype=np.int8), [0]])))
    return [(int(a), int(b)) for a, b in edges.reshape(-1, 2)]


def _svg(width: int, height: int, parts: Sequence[str]) -> str:
    return f'<svg width="{width}" height="{height}" viewBox="0 0 {width} {height}">{"".join(parts)}</svg>'


def _text(text: str) -> str:
    return html.escape(str(text))
