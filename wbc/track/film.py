"""Pictures one after the other as a file: MP4 where an encoder is installed, else GIF."""

from __future__ import annotations

import functools
import importlib
import pathlib
import shutil
import subprocess
from collections.abc import Sequence

from PIL import Image

#: Colours of a GIF; all its pictures have the same, so that what stands still is stored once
COLOURS = 160


@functools.cache
def encoder() -> str | None:
    """The ffmpeg that is on the path, or in the wheel imageio-ffmpeg; None where neither is."""
    if found := shutil.which("ffmpeg"):
        return found
    try:
        return str(importlib.import_module("imageio_ffmpeg").get_ffmpeg_exe())
    except (ImportError, RuntimeError):
        return None


def save_film(frames: Sequence[Image.Image], file: pathlib.Path, rate: float, colours: int = COLOURS) -> pathlib.Path:
    """Write ``rate`` pictures a second, all of one size; returns the file: its suffix becomes ``.mp4`` or ``.gif``."""
    program = encoder()
    if program is not None and (made := _encoded(program, frames, file.with_suffix(".mp4"), rate)):
        return made
    palette = frames[len(frames) // 2].quantize(colours, method=Image.Quantize.FASTOCTREE)
    reduced = [frame.quantize(palette=palette, dither=Image.Dither.NONE) for frame in frames]
    file = file.with_suffix(".gif")
    between = max(20, round(1000.0 / rate))
    reduced[0].save(file, save_all=True, append_images=reduced[1:], duration=between, loop=0, optimize=False)
    return file


def _encoded(program: str, frames: Sequence[Image.Image], file: pathlib.Path, rate: float) -> pathlib.Path | None:
    """By ffmpeg, in the form that every browser plays; None where this ffmpeg cannot."""
    wide, tall = frames[0].size
    command = [program, "-y", "-loglevel", "error", "-f", "rawvideo", "-pix_fmt", "rgb24", "-s", f"{wide}x{tall}"]
    command += ["-r", f"{rate:g}", "-i", "-", "-an", "-c:v", "libx264", "-pix_fmt", "yuv420p", "-crf", "23"]
    # H.264 has a colour for two pixels by two
    command += ["-vf", "pad=ceil(iw/2)*2:ceil(ih/2)*2", "-movflags", "+faststart", str(file)]
    content = b"".join(frame.convert("RGB").tobytes() for frame in frames)
    done = subprocess.run(command, input=content, capture_output=True, check=False)
    if done.returncode == 0 and file.is_file():
        return file
    file.unlink(missing_ok=True)
    return None
