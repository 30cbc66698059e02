"""The journal: whole lines or none, also after a crash, on a full disk, or at once."""

import itertools
import json
import os
import resource
import subprocess
import sys
import textwrap

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tdac_agent.storage.blobs import Blobs
from tdac_agent.storage.journal import append_record, read_records, repair_end
from tdac_agent.storage.locks import LOCK_FILE, hold, is_held

# As journals of ours are: a longer number is nobody's.
NUMBERS = st.integers(-(2**63), 2**63 - 1)
RECORDS = st.lists(
    st.dictionaries(st.text(), st.none() | NUMBERS | st.text(), max_size=3),
    max_size=5,
)


def test_lines_are_on_the_disk_at_once(tmp_path, monkeypatch):
    """Every record is one write of a whole line, forced out before one goes on."""
    calls = []
    write, sync = os.write, os.fsync

    def wrote(handle, data):
        calls.append(data)
        return write(handle, data)

    monkeypatch.setattr("os.write", wrote)
    monkeypatch.setattr("os.fsync", lambda handle: calls.append(sync(handle)))
    append_record(tmp_path / "j", {"n": 0})
    del calls[:]
    append_record(tmp_path / "j", {"n": 1, "text": "a\nb"})
    assert calls == [b'{"n": 1, "text": "a\\nb"}\n', None]
    assert [record["n"] for record in read_records(tmp_path / "j")] == [0, 1]


@settings(deadline=None, max_examples=50)
@given(RECORDS, st.data())
def test_a_torn_tail(tmp_path_factory, records, data):
    """Wherever it was cut: what was whole is read, and the next line is whole."""
    path = tmp_path_factory.getbasetemp() / "torn.jsonl"
    lines = [json.dumps(record).encode() + b"\n" for record in records]
    raw, ends = b"".join(lines), [0, *itertools.accumulate(map(len, lines))]
    cut = data.draw(st.integers(0, len(raw)))
    garbage = data.draw(st.sampled_from([b"", b"\0\0\0", b"\xff{", b'{"a": ']))
    # A line without its end alone is whole; with other bytes after it, it is none.
    whole = [r for r, end in zip(records, ends[1:], strict=True) if end <= cut]
    if not garbage and cut + 1 in ends:
        whole = records[: ends.index(cut + 1)]
    path.write_bytes(raw[:cut] + garbage)
    assert read_records(path) == whole
    repair_end(path)
    assert read_records(path) == whole
    append_record(path, {"last": 1})
    assert read_records(path) == [*whole, {"last": 1}]
    lines = path.read_bytes().split(b"\n")
    assert lines.pop() == b""
    assert all(isinstance(json.loads(line), dict) for line in lines)


@pytest.mark.parametrize("line", [b"", b"[]", b"7", b"\xff", b"[" * 9**5, b"{" * 999])
def test_foreign_lines(tmp_path, line):
    """What is no record is none, wherever it stands."""
    path = tmp_path / "j"
    path.write_bytes(b'{"n": 1}\n' + line + b'\n{"n": 2}\n' + line)
    assert [record["n"] for record in read_records(path)] == [1, 2]


def test_a_missing_journal(tmp_path):
    """It has no records, and nothing to mend."""
    repair_end(tmp_path / "j")
    assert read_records(tmp_path / "j") == []
    assert list(tmp_path.iterdir()) == []


def test_a_full_disk(tmp_path):
    """A line that does not fit is taken back, and the error names the file."""
    path = tmp_path / "j"
    append_record(path, {"n": 1})
    before = path.read_bytes()
    source = """
        import sys
        from pathlib import Path
        from tdac_agent.storage.journal import append_record
        try:
            append_record(Path(sys.argv[1]), {"text": "x" * 1000})
        except OSError as error:
            print(error.filename, error.strerror)
        append_record(Path(sys.argv[1]), {"n": 2})
        """

    def small_files():
        resource.setrlimit(resource.RLIMIT_FSIZE, (100, 100))

    done = subprocess.run(
        [sys.executable, "-c", textwrap.dedent(source), str(path)],
        stdout=subprocess.PIPE,
        preexec_fn=small_files,
        text=True,
        check=True,
    )
    assert done.stdout == f"{path} File too large\n"
    assert path.read_bytes() == before + b'{"n": 2}\n'


@settings(deadline=None, max_examples=10)
@given(st.text())
def test_a_text_is_found_by_its_hash(tmp_path_factory, text):
    """As it was put; a damaged or unknown one is none."""
    blobs = Blobs(tmp_path_factory.getbasetemp() / "blobs")
    name = blobs.put(text)
    assert blobs.put(text) == name
    assert blobs.get(name) == text
    (blobs.folder / name).write_bytes(b"other than that")
    assert blobs.get(name) is None
    assert blobs.get("0" * 64) is None
    assert blobs.get("\0") is None
    assert blobs.put(text) == name
    assert blobs.get(name) == text


def test_a_lock_ends_with_its_process(tmp_path):
    """Two processes never hold it together; killed with -9, one lets go of it."""
    source = """
        import sys
        from pathlib import Path
        from tdac_agent.storage.locks import hold
        with hold(Path(sys.argv[1])) as mine:
            print(mine, flush=True)
            sys.stdin.read()
        """
    file = tmp_path / LOCK_FILE
    assert not is_held(file)
    other = subprocess.Popen(
        [sys.executable, "-c", textwrap.dedent(source), str(file)],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )
    assert other.stdout.readline() == "True\n"
    assert is_held(file)
    with hold(file) as mine:
        assert not mine
    other.kill()
    other.communicate()
    assert not is_held(file)
    with hold(file) as mine:
        assert mine


def test_numbers_have_64_bits(tmp_path):
    """The least and the greatest are read; a line with a longer one is none."""
    numbers = [-(2**63), 2**63 - 1, 2**63]
    (tmp_path / "j").write_text("".join(f'{{"n": {n}}}\n' for n in numbers))
    assert [record["n"] for record in read_records(tmp_path / "j")] == numbers[:2]
