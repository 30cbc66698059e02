"""The lint rule that finds reads that bypass the safe reader."""

import pytest

from tools.raw_reads import main, raw_reads

READS = [
    "open(path)",
    "open(path, 'rb')",
    "open(path, mode='r')",
    "open(path, 'r+b')",
    "path.open()",
    "path.open('rb')",
    "path.open(encoding='utf-8')",
    "path.read_text('utf-8')",
    "(folder / 'x').read_bytes()",
    "np.load(path)",
    "json.load(file)",
    "csv.reader(open(path))",
    "csv.DictReader(path.open(newline=''))",
    "yaml.load(path, Loader)",
    "pd.read_csv(path)",
    "zipfile.ZipFile(path)",
    "cv2.imread(str(path))",
]
OTHERS = [
    "open(path, 'w')",
    "open(path, mode='ab')",
    "path.open('a', encoding='utf-8')",
    "os.open(path, os.O_RDONLY)",
    "entry.open(spec, base)",
    "webbrowser.open(address)",
    "read_file(path, 100)",
    "read_bytes(path)",
    "np.load(io.BytesIO(raw), allow_pickle=False)",
    "pd.read_csv(io.StringIO(text))",
    "json.loads(text)",
    "zipfile.ZipFile(path, 'w')",
]


@pytest.mark.parametrize("line", READS)
def test_a_raw_read_is_found(line):
    """Whatever reads a path, with its line, unless a comment says why."""
    source = f"import x\n\nfound = {line}\n"
    assert [number for number, _ in raw_reads(source)][:1] == [3]
    assert not list(raw_reads(f"{source.rstrip()}  # raw read: shipped\n"))
    assert not list(raw_reads(f"# raw read: shipped\nfound = {line}\n"))
    assert list(raw_reads(f"# raw read: \nfound = {line}\n"))
    assert list(raw_reads(f"# raw read: shipped\n\nfound = {line}\n"))


@pytest.mark.parametrize("line", OTHERS)
def test_what_is_no_raw_read(line):
    """Writing, reading from memory, and the safe reader."""
    assert not list(raw_reads(f"found = {line}\n"))


def test_a_folder_is_searched(tmp_path, capsys):
    """Both packages, but for the places that are allowed as a whole."""
    for name in ("tdac_envs/core/intake.py", "tdac_agent/cli/new.py"):
        (tmp_path / name).parent.mkdir(parents=True)
        (tmp_path / name).write_text("text = path.read_text()\n")
    assert main(tmp_path) == 1
    out = capsys.readouterr().out
    assert "tdac_agent/cli/new.py:1: .read_text bypasses" in out
    assert "intake.py:" not in out
