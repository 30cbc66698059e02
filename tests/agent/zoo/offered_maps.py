"""Maps that somebody else offers: pictures, ROS maps, MovingAI grids, map folders."""

from __future__ import annotations

import io
import json
import os
import struct
import zlib
from pathlib import Path

import cv2
import numpy as np
from offers import Maker, Offer


def text(name: str, content: str | bytes) -> Maker:
    """Writes one file."""
    raw = content.encode() if isinstance(content, str) else content
    return lambda here: (here / name).write_bytes(raw)


def link(name: str, target: str) -> Maker:
    """Makes a link."""
    return lambda here: (here / name).symlink_to(target)


def pipe(name: str) -> Maker:
    """Makes a pipe that nobody writes to."""
    return lambda here: os.mkfifo(here / name)


def draw(here: Path) -> None:
    """Writes `plan.png`: a room of 140 x 100 px."""
    picture = np.full((100, 140), 255, np.uint8)
    picture[:4] = picture[-4:] = picture[:, :4] = picture[:, -4:] = 0
    cv2.imwrite(str(here / "plan.png"), picture)


def ros(**fields: str) -> Maker:
    """A ROS map of `plan.png` with some fields written otherwise."""
    known = {"image": "plan.png", "resolution": "0.05", "origin": "[0, 0, 0]"} | fields
    content = "".join(f"{key}: {value}\n" for key, value in known.items())

    def make(here: Path) -> None:
        draw(here)
        (here / "map.yaml").write_text(content)

    return make


def movingai(height: str, width: str = "3") -> Maker:
    """A grid of two rows of three cells that says something else."""
    header = f"type octile\nheight {height}\nwidth {width}\nmap\n...\n...\n"
    return text("map.map", header)


def png(width: int, height: int) -> bytes:
    """A picture with any size in its header, and hardly a pixel."""

    def chunk(kind: bytes, body: bytes) -> bytes:
        tail = struct.pack(">I", zlib.crc32(kind + body))
        return struct.pack(">I", len(body)) + kind + body + tail

    header = struct.pack(">IIBBBBB", width, height, 8, 0, 0, 0, 0)
    pixels = chunk(b"IDAT", zlib.compress(bytes(10)))
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + pixels


def grid(header: str | None = None, **params: object) -> Maker:
    """A map folder; of the grid's header or of the parameters something is changed."""

    def make(here: Path) -> None:
        content = io.BytesIO()
        np.save(content, np.zeros((20, 30), np.bool_))
        raw = content.getvalue()
        if header is not None:
            raw = raw[:10] + header.encode().ljust(len(raw) - 610)[:-1] + b"\n"
        told = {"source": "x", "source_sha256": "", "width": 30, "height": 20}
        told |= {"polarity": "given", "method": "given", "start": [5, 5]}
        (here / "folder").mkdir()
        (here / "folder" / "occupancy.npy").write_bytes(raw)
        parameters = json.dumps(told | {"goal": [25, 15]} | params)
        (here / "folder" / "params.json").write_text(parameters)
        (here / "task.yaml").write_text("{map: folder, robot: {radius: 2}}")

    return make


def _picture(name: str, make: Maker, says: str, endless: bool = False) -> Offer:
    return _other(name, "map.png", make, says, endless)


def _other(
    name: str, file: str, make: Maker, says: str, endless: bool = False
) -> Offer:
    return Offer("maps", name, ("map", file), make, says, endless=endless)


def _folder(name: str, make: Maker, says: str) -> Offer:
    words = ("synth", "--task", "task.yaml", "--dry-run")
    return Offer("maps", name, words, make, says)


_HUGE = "{'descr': '|b1', 'fortran_order': False, 'shape': (1000000, 1000000), }"
_OBJECT = "{'descr': '|O', 'fortran_order': False, 'shape': (20, 30), }"
_NEGATIVE = "{'descr': '|b1', 'fortran_order': False, 'shape': (-20, -30), }"
_DEEP = "(" * 100

OFFERS = [
    _picture("endless", link("map.png", "/dev/zero"), "not a regular file", True),
    _picture("pipe", pipe("map.png"), "not a regular file", True),
    _picture("random", link("map.png", "/dev/urandom"), "not a regular file", True),
    _picture("kernel_log", link("map.png", "/proc/kmsg"), "map.png", True),
    _picture("memory", link("map.png", "/proc/self/mem"), "map.png", True),
    _picture("loop", link("map.png", "map.png"), "map.png"),
    _picture("terminal", link("map.png", "/dev/tty"), "map.png", True),
    _picture("empty", text("map.png", b""), "not an image"),
    _picture("large_header", text("map.png", png(60_000, 60_000)), "megapixels"),
    _picture("torn", text("map.png", png(100, 100)), "damaged"),
    _picture("pgm_digits", text("map.png", b"P5 " + b"9" * 5000 + b" 2 255\n"), "map"),
    _picture("pgm_text", text("map.png", b"P2 9999999 9999999 255\n"), "megapixels"),
    _other("long_name", "m" * 5000, draw, "File name too long"),
    _other("sparse", "map.png", lambda here: os.truncate(_touched(here), 10**12), "MB"),
    _other("ros_endless", "map.yaml", ros(image="/dev/zero"), "not a regular", True),
    _other("ros_itself", "map.yaml", ros(image="map.yaml"), "not an image"),
    _other("ros_nan", "map.yaml", ros(resolution=".nan"), "not a finite number"),
    _other("ros_tiny", "map.yaml", ros(resolution="1.0e-300"), "resolution"),
    _other("ros_far", "map.yaml", ros(origin="[1.0e+300, 0, 0]"), "origin"),
    _other("ros_date", "map.yaml", ros(mode="2001-99-99"), "not valid YAML"),
    _other("ros_deep", "map.yaml", ros(origin="[" * 3000), "nested deeper"),
    _other("ros_laughs", "map.yaml", ros(a="&a [1, 1]", b="&b [*a, *b]"), "values"),
    _other("ros_digits", "map.yaml", ros(resolution="9" * 5000), "digits"),
    _other("ros_code", "map.yaml", ros(mode="!!python/name:os.system x"), "YAML"),
    _other("movingai_digits", "map.map", movingai("9" * 5000), "not a MovingAI map"),
    _other("movingai_superscript", "map.map", movingai("²"), "not a MovingAI map"),
    _other("movingai_large", "map.map", movingai("99999999", "9"), "megapixels"),
    _other("movingai_rows", "map.map", movingai("3"), "expected 3 rows of 3 cells"),
    _folder("grid_huge", grid(_HUGE), "cannot read the grid"),
    _folder("grid_object", grid(_OBJECT), "cannot read the grid"),
    _folder("grid_negative", grid(_NEGATIVE), "grid"),
    _folder("grid_deep", grid(_DEEP), "cannot read the grid"),
    _folder("grid_of_another_size", grid(width=31), "params.json says 31 x 20"),
    _folder("params_far", grid(start=[1e300, 5]), "start"),
    _folder("params_rays", grid(robot={"n_rays": 10**9}), "n_rays"),
    _folder("params_resolution", grid(resolution=-1), "resolution"),
]


def _touched(here: Path) -> Path:
    (here / "map.png").touch()
    return here / "map.png"
