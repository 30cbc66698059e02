"""No picture of the docs is older than what it shows."""

import re

import pytest
from PIL import Image

from tools.gallery import (
    FACTS,
    KINDS,
    LEVELS,
    NAMES,
    TIMED,
    recorded,
    said,
    write_answer,
)
from tools.pictures import DOCS, PICTURES, ROOT, inputs_hash, stale


def test_no_picture_is_stale():
    """Otherwise `make pictures` draws it again."""
    assert stale() == []


def test_each_picture_has_a_command():
    """And each is shown on a page."""
    found = {
        file.relative_to(DOCS).as_posix()
        for suffix in ("png", "gif")
        for file in DOCS.rglob(f"*.{suffix}")
    }
    assert found == set(PICTURES)
    pages = [ROOT / "README.md", *DOCS.glob("*.md")]
    text = " ".join(page.read_text(encoding="utf-8") for page in pages)
    assert found == {name for name in found if re.search(rf"\b{name}\b", text)}


@pytest.mark.parametrize("name", PICTURES)
def test_another_input_is_seen(name, monkeypatch, tmp_path):
    """A changed byte of an input changes the hash."""
    picture = PICTURES[name]
    for pattern in picture.inputs:
        for file in ROOT.glob(pattern):
            copy = tmp_path / file.relative_to(ROOT)
            copy.parent.mkdir(parents=True, exist_ok=True)
            copy.write_bytes(file.read_bytes()) if file.is_file() else None
    before = inputs_hash(picture)
    monkeypatch.setattr("tools.pictures.ROOT", tmp_path)
    assert inputs_hash(picture) == before
    first = next(file for file in tmp_path.rglob("*") if file.is_file())
    first.write_bytes(first.read_bytes() + b"\n")
    assert inputs_hash(picture) != before


@pytest.mark.parametrize("name", NAMES)
def test_the_gallery_says_what_was_driven(name):
    """The text below a picture is what its drive kept, and what the tables record."""
    level, kind = name.split("-")
    with Image.open(DOCS / "gallery" / f"{name}.png") as picture:
        told = picture.info[FACTS]
    page = (DOCS / "gallery.md").read_text(encoding="utf-8")
    assert f"![{told}](gallery/{name}.png)" in page
    words = told.partition(": ")[2]
    (row,) = [line for line in page.splitlines() if f"/{name}.png" in line]
    cells = page.splitlines()[page.splitlines().index(row) + 1].split("|")
    assert cells[1 + list(KINDS).index(kind)].strip() == words
    if level in LEVELS:
        kept = said(*recorded(level, kind))
        assert words == kept or (
            kind == TIMED and words.endswith(f"(recorded: {kept})")
        )


def test_answers_of_the_gallery_are_the_recorded_ones(tmp_path):
    """A file is code of the reply of its level, unedited."""
    for level in LEVELS:
        code = write_answer(level, tmp_path).read_text(encoding="utf-8")
        compile(code, level, "exec")
        reply = f"results/ladder/genuine/{level}/1/reply.md"
        assert code.strip() in (ROOT / reply).read_text(encoding="utf-8")


def test_the_gallery_is_small():
    """Its pictures have at most a megabyte."""
    files = list((DOCS / "gallery").glob("*.png"))
    assert sum(file.stat().st_size for file in files) < 1_000_000
