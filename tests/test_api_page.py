"""The examples of the page on the API run as they stand, one after another."""

import importlib.util
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

PAGE = (Path(__file__).parents[1] / "docs" / "api.md").read_text("utf-8")
PARTS = re.split(r"^## ", PAGE, flags=re.MULTILINE)[1:]
EXAMPLE = re.compile(r"^```python\n(.*?)^```", re.MULTILINE | re.DOTALL)


@pytest.mark.parametrize("part", PARTS, ids=[part.splitlines()[0] for part in PARTS])
def test_each_part_begins_with_an_example(part):
    """Python that compiles, before the first entry of the reference."""
    found = EXAMPLE.search(part)
    assert found, "no example"
    assert found.start() < part.index("{eval-rst}")
    compile(found[1], "example", "exec")


@pytest.mark.slow
def test_the_examples_run(tmp_path):
    """In an empty folder; the one that needs stable-baselines3 if it is installed."""
    examples = EXAMPLE.findall(PAGE)
    assert len(examples) == len(PARTS)
    if importlib.util.find_spec("stable_baselines3") is None:
        examples = [text for text in examples if "stable_baselines3" not in text]
    (tmp_path / "examples.py").write_text("\n".join(examples), "utf-8")
    done = subprocess.run(
        [sys.executable, "examples.py"], cwd=tmp_path, text=True, timeout=1800,
        capture_output=True, check=False,
        env={**os.environ, "XDG_STATE_HOME": str(tmp_path)},
    )  # fmt: skip
    assert done.returncode == 0, f"{done.stdout}\n{done.stderr}"
    assert (tmp_path / "report.html").stat().st_size > 10_000
