"""No picture of the docs is older than what it shows."""

import re

import pytest

from tools.pictures import DOCS, PICTURES, ROOT, inputs_hash, stale


def test_no_picture_is_stale():
    """Otherwise `make pictures` draws it again."""
    assert stale() == []


def test_each_picture_has_a_command():
    """And each is shown on a page."""
    found = {
        file.name for suffix in ("png", "gif") for file in DOCS.glob(f"*.{suffix}")
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
