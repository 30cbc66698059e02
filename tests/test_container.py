"""The steps of the Dockerfile, as far as they need no container engine."""

import os
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]


@pytest.mark.slow
def test_the_installation_works_for_another_folder(tmp_path):
    """Compiled once, by whoever installs; a user then waits for nothing."""
    prefix, work = tmp_path / "tdac", tmp_path / "work"
    work.mkdir()
    script = ROOT / "tools/install_in_container.sh"
    subprocess.run(["sh", script, ROOT, prefix], check=True, cwd=work)
    found = subprocess.run(
        [prefix / "bin/tdac", "synth", "--out", "runs/maze-1"],
        check=True,
        cwd=work,
        env={**os.environ, "XDG_CACHE_HOME": str(tmp_path / "cache")},
        capture_output=True,
        text=True,
    )
    assert "✔ verified: " in found.stdout
    assert "compiling" not in found.stderr
    assert (work / "runs/maze-1/controller.py").is_file()


def test_the_dockerfile_runs_these_steps():
    lines = (ROOT / "Dockerfile").read_text().splitlines()
    steps = [line for line in lines if "install_in_container.sh" in line]
    assert len(steps) == 1
    assert "USER tdac" in lines
    # Whatever is copied after it would be owned by root.
    assert lines.index("USER tdac") > max(
        number for number, line in enumerate(lines) if line.startswith("COPY")
    )
