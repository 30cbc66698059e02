"""A controller that fails: it plans for a point, and its body hits a corner."""

from __future__ import annotations

from pathlib import Path

from tools.run import tdac

TASK = "office"
SIZES = "ROBOT_RADIUS_PX = ", "MARGIN_PX = ", "KEPT_GAP_PX = "
"""Lines of the template by which it keeps its body from walls."""


def write(folder: Path) -> Path:
    """Writes it: the template's controller of `TASK`, with no room for the body."""
    run = folder / "template"
    tdac("synth", "--task", TASK, "--no-confirm", "--out", str(run))
    lines = (run / "controller.py").read_text(encoding="utf-8").splitlines(True)
    found = [n for n, line in enumerate(lines) if line.startswith(SIZES)]
    assert len(found) == len(SIZES)
    for n in found:
        lines[n] = f"{lines[n].split(' = ')[0]} = 0.5\n"
    file = folder / "controller.py"
    file.write_text("".join(lines), encoding="utf-8")
    return file
