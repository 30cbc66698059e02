"""CONTRIBUTING.md leads to code that exists."""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
TEXT = (ROOT / "CONTRIBUTING.md").read_text("utf-8")
ROWS = re.findall(r"^\| (.+?) \| (.+) \|$", TEXT, re.MULTILINE)[1:]
PLACE = re.compile(r"[\w./*-]+/[\w./*-]*|[\w*-]+\.(?:py|yaml|j2|toml)")
NAME = re.compile(r"[A-Za-z_]\w*(?:\.[A-Za-z_]\w*)*")


def places(words):
    """The files of a row; a bare name is in the folder of one that precedes it."""
    folders, found = [ROOT], {}
    for word in words:
        if not PLACE.fullmatch(word):
            continue
        pattern = word.replace("NAME", "*").rstrip("/")
        near = [path for at in reversed(folders) for path in at.glob(pattern)]
        near = near or [*(ROOT / "tdac_agent").glob(pattern)]
        near = near or [*(ROOT / "tdac_envs").glob(pattern)]
        found[word] = near
        folders += [path if path.is_dir() else path.parent for path in near[:1]]
    return found


@pytest.mark.parametrize("row", ROWS, ids=[row[0][:40] for row in ROWS])
def test_a_row_names_what_exists(row):
    """Each file in it exists, and one of these files has each name in it."""
    words = re.findall(r"`([^`]+)`", row[1])
    found = places(words)
    assert all(found.values()), found
    paths = {path for group in found.values() for path in group}
    files = {
        f for path in paths for f in ([path] if path.is_file() else path.glob("*.*"))
    }
    text = "\n".join(file.read_text("utf-8") for file in files)
    for word in words:
        if NAME.fullmatch(word) and word not in found and word != "NAME":
            for part in word.split("."):
                assert re.search(rf"\b{part}\b", text), f"{word} is not in {found}"
