"""Runs Python and tdac as processes of their own, for the other tools."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[1]


def python(*words: str, may_fail: bool = False) -> None:
    """Runs Python in the project's folder.

    Raises:
        SystemExit: It did not succeed, and may not fail.
    """
    done = subprocess.run([sys.executable, *words], cwd=ROOT, check=False)
    if done.returncode and not may_fail:
        raise SystemExit(f"this did not succeed: python {' '.join(words)}")


def tdac(*words: str, may_fail: bool = False) -> None:
    """Runs a command of tdac, as `python` does."""
    python("-m", "tdac_agent", *words, may_fail=may_fail)
