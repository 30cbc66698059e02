"""Without the extra `test` the tests say so."""

import os
import subprocess
import sys
from pathlib import Path


def test_what_is_missing_is_one_line_with_the_command(tmp_path):
    """Bare `pytest` where only the package itself is installed."""
    root = Path(__file__).parents[1]
    missing = "raise ModuleNotFoundError(\"No module named 'hypothesis'\")"
    (tmp_path / "hypothesis.py").write_text(missing)
    rest = os.environ.get("PYTHONPATH")
    done = subprocess.run(
        [sys.executable, "-m", "pytest", "-p", "no:cacheprovider"],
        env=os.environ
        | {"PYTHONPATH": os.pathsep.join([str(tmp_path), *([rest] if rest else [])])},
        cwd=root,
        capture_output=True,
        text=True,
        check=False,
    )
    assert (done.returncode, done.stdout) == (4, "")
    (line,) = done.stderr.strip().splitlines()
    assert f"the tests need the extra `test`: {sys.executable} -m pip install" in line
    assert f"{root}[test]" in line
