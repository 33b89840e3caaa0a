"""Films: MP4 by an encoder, GIF without."""

from __future__ import annotations

import stat
from pathlib import Path

import pytest
from PIL import Image

from wbc.track import film
from wbc.track.page import RunPage

FRAMES = [Image.new("RGB", (9, 6), (250, 250, 250)) for _ in range(3)]
for _k, _frame in enumerate(FRAMES):
    _frame.paste((20, 20, 20), (2 * _k, 0, 2 * _k + 2, 3))


@pytest.fixture(autouse=True)
def _forgotten() -> None:
    film.encoder.cache_clear()


def program(folder: Path, text: str) -> None:
    """An ffmpeg that is none."""
    file = folder / "ffmpeg"
    file.write_text(f"#!/bin/sh\n{text}\n")
    file.chmod(file.stat().st_mode | stat.S_IXUSR)


def test_without_an_encoder_a_film_is_a_gif(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(film, "encoder", lambda: None)
    file = film.save_film(FRAMES, tmp_path / "some.film", 10.0)
    assert file.name == "some.gif"
    with Image.open(file) as image:
        assert (image.size, getattr(image, "n_frames", 1), image.info["duration"]) == ((9, 6), 3, 100)


def test_an_encoder_gets_every_picture_and_one_that_fails_leaves_a_gif(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("PATH", str(tmp_path))
    program(tmp_path, 'for last; do :; done\n/bin/cat > "$last"')
    file = film.save_film(FRAMES, tmp_path / "some", 10.0)
    assert file.name == "some.mp4"
    assert file.read_bytes() == b"".join(frame.tobytes() for frame in FRAMES)
    page = RunPage("a run")
    page.picture(file)
    assert "video/mp4;base64" in page.save(tmp_path).read_text()
    program(tmp_path, "exit 1")
    assert film.save_film(FRAMES, tmp_path / "other", 10.0).name == "other.gif"
    assert not (tmp_path / "other.mp4").exists()
