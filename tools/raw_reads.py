"""Finds reads of files that bypass the safe reader: `python -m tools.raw_reads`.

A file of a user's folder may be a pipe, a device or too large for the memory. It is
read by `tdac_envs.core.intake.read_file`, or by what is built on it. Another read is
allowed in the places of `ALLOWED`, and with a comment `# raw read: REASON` in its lines
or above them.
"""

from __future__ import annotations

import ast
import sys
from collections.abc import Iterator
from pathlib import Path

PACKAGES = "tdac_agent", "tdac_envs"
MARKER = "# raw read: "
ALLOWED = {
    "tdac_envs/core/intake.py": "the safe reader",
    "tdac_envs/controller_kit/": "given to controllers, which read in a sandbox",
    "tdac_agent/builtin/levels/": "controllers, which read in a sandbox",
    "tdac_agent/planners/files/": "controllers, which read in a sandbox",
    "tdac_agent/environments/epuck/adapter.py": "a Webots controller",
}
METHODS = {"read_text", "read_bytes"}
FUNCTIONS = {
    *("np.load", "np.loadtxt", "np.genfromtxt", "np.fromfile", "np.memmap"),
    *("json.load", "yaml.load", "yaml.safe_load", "pickle.load", "torch.load"),
    *("pd.read_csv", "pd.read_json", "pd.read_pickle", "cv2.imread", "io.open"),
    *("Image.open", "zipfile.ZipFile"),
}
IN_MEMORY = {"io.BytesIO", "io.StringIO", "BytesIO", "StringIO"}


def raw_reads(source: str) -> Iterator[tuple[int, str]]:
    """Yields line and name of each read without a reason in a source."""
    lines = source.splitlines()
    for node in ast.walk(ast.parse(source)):
        if not isinstance(node, ast.Call):
            continue
        name = _read(node)
        reasons = lines[max(0, node.lineno - 2) : node.end_lineno]
        if name and not any(_has_reason(line) for line in reasons):
            yield node.lineno, name


def _has_reason(line: str) -> bool:
    return bool(line.partition(MARKER)[2].strip())


def _read(call: ast.Call) -> str:
    """The name of a function that reads a file; empty for any other call."""
    name = ast.unparse(call.func)
    if name in FUNCTIONS:
        return "" if _is_harmless(call) else name
    if isinstance(call.func, ast.Attribute):
        method = call.func.attr
        if method in METHODS or (method == "open" and _is_path_open(call)):
            return f".{method}"
        return ""
    return name if name == "open" and "r" in _mode(call, 1) else ""


def _is_harmless(call: ast.Call) -> bool:
    """Whether a function reads what is in memory, or writes."""
    if "w" in _mode(call, 1):
        return True
    first = call.args[0] if call.args else None
    return isinstance(first, ast.Call) and ast.unparse(first.func) in IN_MEMORY


def _is_path_open(call: ast.Call) -> bool:
    """Whether a method `open` has the arguments of `Path.open` and reads."""
    first = call.args[0] if call.args else None
    if first is not None and not isinstance(first, ast.Constant):
        return False
    return "r" in _mode(call, 0)


def _mode(call: ast.Call, place: int) -> str:
    """The mode of a call, which is its argument `mode` or that at a place."""
    given = [each.value for each in call.keywords if each.arg == "mode"]
    given += call.args[place : place + 1]
    value = given[0] if given else None
    return str(value.value) if isinstance(value, ast.Constant) else "r"


def main(folder: Path = Path()) -> int:
    """Prints the reads without a reason; returns 1 if there are some."""
    found = 0
    for package in PACKAGES:
        for file in sorted((folder / package).rglob("*.py")):
            at = file.relative_to(folder).as_posix()
            if at.startswith(tuple(ALLOWED)):
                continue
            for line, name in raw_reads(file.read_text(encoding="utf-8")):
                found += 1
                print(f"{at}:{line}: {name} bypasses tdac_envs.core.intake.read_file")
    if found:
        print(f"{found} raw reads: use read_file, or say why not with `{MARKER}REASON`")
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
