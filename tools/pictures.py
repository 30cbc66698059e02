"""Draws the pictures of the docs: `python -m tools.pictures [NAME …]`.

Without names, those whose inputs have changed since they were drawn are drawn again.
`docs/pictures.json` keeps a hash of the inputs of each; `--check` compares and draws
nothing. Inputs are the tool that draws it, what it draws with, and the data it shows.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import shutil
import sys
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from tdac_agent.storage.files import write_atomic
from tools import for_a_point
from tools.gallery import NAMES
from tools.run import ROOT, python, tdac

DOCS = ROOT / "docs"
RECORD = DOCS / "pictures.json"
DRAWING = "tdac_envs/drawing/*.py"
STUDIO = "tdac_agent/studio/pages/[hcl]*.py", "tdac_agent/studio/pages/style.py"
"""The first page, its map, the frame of all pages, and their style."""


@dataclass(frozen=True, slots=True)
class Picture:
    """How a picture is drawn.

    Attributes:
        draw: Writes it into a folder, under its name.
        inputs: What it shows and is drawn with: patterns of files of the project.
    """

    draw: Callable[[Path], None]
    inputs: tuple[str, ...]


def tool(name: str) -> Callable[[Path], None]:
    """A tool of this folder that writes a picture."""

    def draw(file: Path) -> None:
        python("-m", f"tools.{name}", str(file))

    return draw


def moving(file: Path) -> None:
    """One of the moving pictures."""
    python("-m", "tools.moving_pictures", str(file.parent), "--only", file.name)


def preview(file: Path) -> None:
    """How the map of the first steps is read."""
    with tempfile.TemporaryDirectory() as name:
        tdac("map", "maze", "--out", name)
        shutil.copy(Path(name) / "preview.png", file)


def maze(file: Path) -> None:
    """The drives of a verified controller."""
    with tempfile.TemporaryDirectory() as name:
        run = Path(name) / "run"
        tdac("synth", "--no-confirm", "--out", str(run))
        shutil.copy(run / "trajectory.png", file)


def failure(file: Path) -> None:
    """What is left of a controller that plans its path for a point."""
    with tempfile.TemporaryDirectory() as name:
        out = Path(name) / "out"
        near = for_a_point.write(Path(name))
        words = "verify", str(near), "--task", for_a_point.TASK, "--out", str(out)
        tdac(*words, may_fail=True)
        shutil.copy(out / "trajectories" / "nominal.png", file)


def gallery(file: Path) -> None:
    """A drive of the gallery."""
    python("-m", "tools.gallery", str(file.parent), file.stem)


PICTURES = {
    "camera.png": Picture(tool("camera_picture"), ("tools/camera_picture.py",)),
    "contact.png": Picture(tool("draw_contact"), ("tools/draw_contact.py", DRAWING)),
    "generated-worlds.png": Picture(
        tool("draw_generated_worlds"), ("tools/draw_generated_worlds.py", DRAWING)
    ),
    "movers.png": Picture(tool("draw_movers"), ("tools/draw_movers.py", DRAWING)),
    "physics.png": Picture(
        tool("draw_solid"), ("tools/draw_solid.py", "tdac_envs/physics/view.py")
    ),
    "studio.png": Picture(tool("draw_studio"), ("tools/draw_studio.py", *STUDIO)),
    "preview.png": Picture(preview, ("tdac_envs/mapping/preview.py", DRAWING)),
    "maze.png": Picture(maze, ("tdac_agent/environments/map2d/pictures.py", DRAWING)),
    "failure.png": Picture(failure, ("tools/for_a_point.py", DRAWING)),
    "repair.gif": Picture(
        moving, ("tools/moving_pictures.py", "tdac_agent/runs/demo/*.json*", DRAWING)
    ),
    **{
        name: Picture(moving, ("tools/moving_pictures.py", DRAWING))
        for name in ("map2d.gif", "epuck.gif", "ladder.gif")
    },
    **{
        f"gallery/{name}.png": Picture(gallery, ("tools/gallery.py", DRAWING))
        for name in NAMES
    },
}


def inputs_hash(picture: Picture) -> str:
    """A hash of the contents of all inputs."""
    total = hashlib.sha256()
    for pattern in picture.inputs:
        files = sorted(ROOT.glob(pattern))
        assert files, pattern
        for file in files:
            if file.is_file():
                total.update(file.relative_to(ROOT).as_posix().encode())
                total.update(file.read_bytes())
    return total.hexdigest()


def stale() -> list[str]:
    """Names of the pictures whose inputs have changed, or that do not exist."""
    kept = json.loads(RECORD.read_text(encoding="utf-8")) if RECORD.is_file() else {}
    return [
        name
        for name, picture in PICTURES.items()
        if kept.get(name) != inputs_hash(picture) or not (DOCS / name).is_file()
    ]


def main() -> int:
    """Draws or checks pictures; returns the exit code."""
    parser = argparse.ArgumentParser(prog="python -m tools.pictures")
    parser.add_argument("names", nargs="*", metavar="NAME", help=", ".join(PICTURES))
    parser.add_argument("--check", action="store_true", help="draw nothing")
    given = parser.parse_args()
    unknown = [name for name in given.names if name not in PICTURES]
    if unknown:
        parser.error(f"no picture {unknown[0]}: {', '.join(PICTURES)}")
    names = given.names or stale()
    if given.check:
        for name in names:
            print(f"docs/{name}: its inputs have changed: make pictures")
        return 1 if names else 0
    for name in names:
        with tempfile.TemporaryDirectory() as folder:
            file = Path(folder) / name
            for parent in (file.parent, (DOCS / name).parent):
                parent.mkdir(exist_ok=True)
            PICTURES[name].draw(file)
            shutil.copy(file, DOCS / name)
        kept = json.loads(RECORD.read_text("utf-8")) if RECORD.is_file() else {}
        kept[name] = inputs_hash(PICTURES[name])
        text = json.dumps(dict(sorted(kept.items())), indent=2) + "\n"
        write_atomic(RECORD, text.encode())
        print(f"docs/{name}", flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
