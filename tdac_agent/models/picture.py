"""Pictures that go with a question, for models that see."""

from __future__ import annotations

import base64
import struct
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from tdac_agent.storage.hashes import sha256_of

LARGEST_SIDE = 1024
"""Longest side of a picture, px."""
MOST_BYTES = 7 << 19
"""Largest PNG file: no RGB picture of that size needs more. Vendors accept 5 MB."""
MEDIA_TYPE: Final = "image/png"
PNG_SIGNATURE = b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR"


@dataclass(frozen=True, slots=True)
class Picture:
    """A picture that goes with a question.

    Attributes:
        file: Absolute path of the picture in the run folder; its name stands in the
            prompt.
        png: Content of the file: at most `LARGEST_SIDE` px wide and high, and at most
            `MOST_BYTES` long.
        caption: What it shows, in a few words.
    """

    file: Path
    png: bytes
    caption: str

    def __post_init__(self) -> None:
        size = len(self.png)
        if size > MOST_BYTES:
            raise ValueError(f"expected at most {MOST_BYTES} bytes, got {size}")
        if not self.png.startswith(PNG_SIGNATURE):
            raise ValueError("expected a PNG file")
        width, height = struct.unpack(">II", self.png[16:24])
        if max(width, height) > LARGEST_SIDE:
            most = f"{LARGEST_SIDE} x {LARGEST_SIDE}"
            raise ValueError(f"expected at most {most} px, got {width} x {height}")

    @property
    def name(self) -> str:
        """Name of the file."""
        return self.file.name

    @property
    def sha256(self) -> str:
        """Hash of the content."""
        return sha256_of(self.png)

    @property
    def base64(self) -> str:
        """The content in base64."""
        return base64.b64encode(self.png).decode()
