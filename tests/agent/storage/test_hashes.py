"""One way to hash: the digests that stored results have."""

import hashlib

import pytest

from tdac_agent.storage.hashes import (
    number_of,
    sha256_of,
    sha256_of_file,
    sha256_of_json,
)


def test_known_digests(tmp_path):
    """Bytes, a text, a file and JSON with sorted keys have the digests of hashlib."""
    empty = "e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855"
    (tmp_path / "empty").touch()
    assert (
        sha256_of(b"") == sha256_of("") == sha256_of_file(tmp_path / "empty") == empty
    )
    assert sha256_of("é\ud800") == hashlib.sha256(b"\xc3\xa9\xed\xa0\x80").hexdigest()
    text = b'{"a": "\\u00e9", "b": [1, 2.5]}'
    value = {"b": [1, 2.5], "a": "é"}
    assert sha256_of_json(value) == hashlib.sha256(text).hexdigest()
    assert number_of("") == 0xE3B0C44298FC1C14


def test_a_file_that_is_too_large_is_not_hashed(tmp_path):
    """Nor one that is not a file."""
    (tmp_path / "long").write_bytes(b"123")
    with pytest.raises(OSError, match="larger than"):
        sha256_of_file(tmp_path / "long", 2)
    with pytest.raises(OSError, match="not a regular file"):
        sha256_of_file("/dev/zero")
