"""Readers of clips: BVH, C3D, AMASS and SMPL, key points; what is wrong in a file is mended and said, or refused."""

from __future__ import annotations

from typing import TYPE_CHECKING

from wbc import lazy

if TYPE_CHECKING:
    from wbc.retarget.sources.loading import CLIP_SUFFIXES as CLIP_SUFFIXES, load_clip as load_clip
else:
    __getattr__, __dir__, __all__ = lazy.attach(__name__, __file__)
