"""Fills the notebooks with their outputs: `python -m tools.notebooks [02 05 …]`.

Each is executed from above to below, and kept with what it printed and drew. A hash of
its code says to which code the outputs belong. `--check` executes nothing: it compares
the hashes, and looks for what must not be kept.
"""

from __future__ import annotations

import argparse
import base64
import hashlib
import io
import json
import os
import re
import sys
import tempfile
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

import nbformat
from nbclient import NotebookClient
from nbformat import NotebookNode
from PIL import Image

ROOT = Path(__file__).parents[1]
FOLDER = ROOT / "notebooks"
OWN = "tdac"
"""Key of the metadata of a notebook."""
SECONDS = 1800
WIDEST = 1600
"""Width of the largest picture, px."""
MOST_BYTES = 4 << 20
"""Largest notebook."""
TEXTS = "plain", "html", "markdown"
MACHINE = re.compile(r"(?<![\w.:/-])/(?:home|root|tmp|work|usr|var|Users)/[\w.-]+")
"""Paths that another machine does not have."""
ADDRESS = re.compile(r" at 0x[0-9a-f]{6,}")
STYLED = re.compile(r"\bT_[0-9a-f]{5}")
"""The random name that pandas gives a styled table."""


def main() -> int:
    """Fills or checks notebooks; returns the exit code."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("names", nargs="*", help="beginnings of names; default: all")
    parser.add_argument("--check", action="store_true", help="execute nothing")
    given = parser.parse_args()
    names = tuple(given.names) or ("",)
    paths = [path for path in notebooks() if path.name.startswith(names)]
    if not paths:
        print(f"no notebook begins with {' or '.join(names)}: {FOLDER.name}/*.ipynb")
        return 2
    if not given.check:
        with ProcessPoolExecutor(max_workers=2) as pool:
            for path, _ in zip(paths, pool.map(fill, paths), strict=True):
                print(f"{path.name}: {path.stat().st_size / 1024:,.0f} KB", flush=True)
    found = [f"{path.name}: {each}" for path in paths for each in problems(path)]
    print(*found, sep="\n", end="\n" if found else "")
    return 1 if found else 0


def notebooks() -> list[Path]:
    """All notebooks, in their order."""
    return sorted(FOLDER.glob("*.ipynb"))


def code_cells(notebook: NotebookNode) -> list[NotebookNode]:
    """The code cells of a notebook."""
    return [cell for cell in notebook.cells if cell.cell_type == "code"]


def code_sha256(notebook: NotebookNode) -> str:
    """The hash of its code, by which its outputs belong to it."""
    sources = json.dumps([cell.source for cell in code_cells(notebook)])
    return hashlib.sha256(sources.encode()).hexdigest()


def fill(path: Path) -> None:
    """Executes a notebook, and keeps it with its outputs.

    Raises:
        CellExecutionError: A cell fails; the file stays as it is.
    """
    notebook = nbformat.read(path, 4)
    kept = notebook.metadata.copy()
    for cell in code_cells(notebook):
        cell.outputs, cell.execution_count = [], None
    with tempfile.TemporaryDirectory() as folder:
        os.environ["IPYTHONDIR"] = folder
        NotebookClient(
            notebook,
            timeout=SECONDS,
            record_timing=False,
            coalesce_streams=True,
            extra_arguments=["--log-level=ERROR"],
            resources={"metadata": {"path": str(path.parent)}},
        ).execute()
    notebook.metadata = NotebookNode({**kept, OWN: {"code": code_sha256(notebook)}})
    for cell in code_cells(notebook):
        for output in cell.outputs:
            _settle(output)
    nbformat.write(notebook, path)


def _settle(output: NotebookNode) -> None:
    """Removes from an output what differs each time, and second forms of a picture."""
    data = output.get("data", {})
    if "image/png" in data:
        data.pop("image/jpeg", None)
    for kind in ("text/html", "text/plain"):
        if kind in data:
            names = {name: f"T_{n}" for n, name in enumerate(_styled(data[kind]))}
            text = STYLED.sub(lambda found, names=names: names[found[0]], data[kind])
            data[kind] = ADDRESS.sub("", text)


def _styled(text: str) -> list[str]:
    return list(dict.fromkeys(STYLED.findall(text)))


def problems(path: Path) -> Iterator[str]:
    """Yields what is wrong with the outputs of a notebook, without executing it."""
    notebook = nbformat.read(path, 4)
    if path.stat().st_size > MOST_BYTES:
        yield f"{path.stat().st_size / 1024:,.0f} KB, at most {MOST_BYTES >> 20} MB"
    if notebook.metadata.get(OWN, {}).get("code") != code_sha256(notebook):
        yield "its outputs are those of other code: make notebooks"
        return
    for number, cell in enumerate(code_cells(notebook), 1):
        if cell.execution_count != number:
            yield f"code cell {number} was not executed in its place: make notebooks"
        for output in cell.outputs:
            yield from (f"code cell {number}: {each}" for each in _wrong(output))


def _wrong(output: NotebookNode) -> Iterator[str]:
    """Yields what must not be kept of an output."""
    if output.output_type == "error":
        yield f"it failed: {output.ename}"
    if output.output_type == "stream" and output.name == "stderr":
        yield f"it warned: {output.text[:80]!r}"
    data = output.get("data", {})
    texts = [output.get("text", ""), *(data.get(f"text/{k}", "") for k in TEXTS)]
    for found in MACHINE.finditer("\n".join(texts)):
        yield f"a path of a machine: {found[0]}"
    if picture := data.get("image/png"):
        width = Image.open(io.BytesIO(base64.b64decode(picture))).width
        if width > WIDEST:
            yield f"a picture is {width} px wide, at most {WIDEST}"


if __name__ == "__main__":
    sys.exit(main())
