"""The notebooks run from above to below, offline, and are kept with their outputs."""

from pathlib import Path

import nbformat
import pytest
from nbclient import NotebookClient
from nbformat.v4 import (
    new_code_cell,
    new_markdown_cell,
    new_notebook,
    new_output,
)

from tools.notebooks import OWN, code_cells, code_sha256, fill, problems

FOLDER = Path(__file__).parents[2] / "notebooks"
NOTEBOOKS = sorted(FOLDER.glob("*.ipynb"))
OFFLINE = """
import socket, sys

def refuse(event, arguments):
    if event == "socket.getaddrinfo":
        raise OSError(f"a notebook looked up {arguments[0]!r}")
    if event == "socket.connect" and arguments[0].family != socket.AF_UNIX:
        host = str(arguments[1][0])
        if not host.startswith("127.") and host != "::1":
            raise OSError(f"a notebook connects to {host}")

sys.addaudithook(refuse)
"""

every_notebook = pytest.mark.parametrize(
    "path", NOTEBOOKS, ids=[path.stem for path in NOTEBOOKS]
)


@pytest.mark.slow
@every_notebook
def test_it_runs_offline(path, tmp_path, monkeypatch):
    """Without an error or a warning; each figure is shown as a vector picture."""
    monkeypatch.setenv("IPYTHONDIR", str(tmp_path))
    monkeypatch.setenv("TMPDIR", str(tmp_path))
    notebook = nbformat.read(path, 4)
    notebook.cells.insert(0, new_code_cell(OFFLINE))
    where = {"metadata": {"path": str(FOLDER)}}
    NotebookClient(notebook, timeout=300, resources=where).execute()
    for cell in code_cells(notebook):
        streams = [one.name for one in cell.outputs if one.output_type == "stream"]
        assert "stderr" not in streams
        if any(line.startswith("plot_") for line in cell.source.splitlines()):
            assert "image/svg+xml" in cell.outputs[-1].data


@every_notebook
def test_its_outputs_are_those_of_its_code(path):
    """All of it was executed in order, on a machine of which nothing is told."""
    notebook = nbformat.read(path, 4)
    nbformat.validate(notebook)
    assert list(problems(path)) == []
    assert any(cell.outputs for cell in code_cells(notebook))


@every_notebook
def test_its_figures_are_kept(path):
    """As vector pictures."""
    for cell in code_cells(nbformat.read(path, 4)):
        if any(line.startswith("plot_") for line in cell.source.splitlines()):
            assert "image/svg+xml" in cell.outputs[-1].data


def small(folder, source, outputs=()):
    """A notebook with one code cell that was executed, as it is kept."""
    notebook = new_notebook(cells=[new_code_cell(source, execution_count=1)])
    notebook.cells[0].outputs = list(outputs)
    notebook.metadata[OWN] = {"code": code_sha256(notebook)}
    nbformat.write(notebook, folder / "small.ipynb")
    return folder / "small.ipynb"


def test_outputs_of_other_code_are_found(tmp_path):
    """Prose may change without them; code may not."""
    path = small(tmp_path, "print(1)", [new_output("stream", text="1")])
    assert list(problems(path)) == []
    notebook = nbformat.read(path, 4)
    notebook.cells.insert(0, new_markdown_cell("One."))
    nbformat.write(notebook, path)
    assert list(problems(path)) == []
    notebook.cells[1].source = "print(2)"
    nbformat.write(notebook, path)
    assert list(problems(path)) == [
        "its outputs are those of other code: make notebooks"
    ]


@pytest.mark.parametrize(
    ("output", "problem"),
    [
        (new_output("stream", text="in /tmp/tmpab12/run"), "/tmp/tmpab12"),
        (new_output("stream", name="stderr", text="slow"), "it warned: 'slow'"),
        (new_output("error", ename="KeyError"), "it failed: KeyError"),
        (
            new_output("execute_result", {"text/html": "<b>/home/me</b>"}),
            "a path of a machine: /home/me",
        ),
    ],
)
def test_what_must_not_be_kept_is_found(tmp_path, output, problem):
    (found,) = problems(small(tmp_path, "x", [output]))
    assert problem in found


def test_a_path_within_the_project_may_be_kept(tmp_path):
    text = "../results/tmp/one.csv, https://example.org/home/x, 3/tmp"
    assert list(problems(small(tmp_path, "x", [new_output("stream", text=text)]))) == []


@pytest.mark.slow
def test_a_notebook_is_filled(tmp_path):
    """With its hash, and without the random name that pandas gives a table."""
    source = "import pandas as pd\npd.DataFrame({'a': [1]}).style"
    path = small(tmp_path, "x")
    notebook = nbformat.read(path, 4)
    notebook.cells[0].source = source
    nbformat.write(notebook, path)
    fill(path)
    assert list(problems(path)) == []
    once = path.read_bytes()
    assert b"T_0" in once
    fill(path)
    assert path.read_bytes() == once


@every_notebook
def test_it_needs_nothing_but_python(path):
    """No commands of a shell, no magic."""
    for cell in code_cells(nbformat.read(path, 4)):
        assert not [s for s in cell.source.splitlines() if s.startswith(("!", "%"))]


def test_there_are_notebooks():
    """Six pages, in their order."""
    numbers = [path.stem[:2] for path in NOTEBOOKS]
    assert numbers == ["01", "02", "03", "04", "05", "06"]
