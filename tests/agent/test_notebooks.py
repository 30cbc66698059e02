"""The notebooks run from above to below, offline, and are kept without outputs."""

from pathlib import Path

import nbformat
import pytest
from nbclient import NotebookClient
from nbformat.v4 import new_code_cell

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


def code_of(notebook):
    """Its code cells."""
    return [cell for cell in notebook.cells if cell.cell_type == "code"]


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
    for cell in code_of(notebook):
        streams = [one.name for one in cell.outputs if one.output_type == "stream"]
        assert "stderr" not in streams
        if any(line.startswith("plot_") for line in cell.source.splitlines()):
            assert "image/svg+xml" in cell.outputs[-1].data


@every_notebook
def test_it_is_kept_without_outputs(path):
    """So that a change of a notebook is a change of what it says."""
    notebook = nbformat.read(path, 4)
    nbformat.validate(notebook)
    for cell in code_of(notebook):
        assert cell.outputs == []
        assert cell.execution_count is None


@every_notebook
def test_it_needs_nothing_but_python(path):
    """No commands of a shell, no magic."""
    for cell in code_of(nbformat.read(path, 4)):
        assert not [s for s in cell.source.splitlines() if s.startswith(("!", "%"))]


def test_there_are_notebooks():
    """Six pages, in their order."""
    numbers = [path.stem[:2] for path in NOTEBOOKS]
    assert numbers == ["01", "02", "03", "04", "05", "06"]
