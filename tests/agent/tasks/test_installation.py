"""The secret of an installation, and the seeds that follow from it."""

import os
import stat
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import pytest
from unconfirmed import synthesize

from tdac_agent.sandbox.exposure import exposure
from tdac_agent.tasks.installation import lasting_secret, seed_of
from tdac_agent.verification.suite.starts import JITTERS, spread_starts
from tdac_agent.verification.verify import verify
from tdac_agent.verification.verify_episodes import verify_episodes

KEYED = "from tdac_agent.tasks.installation import keyed; print(keyed(b'x').hex())"
LINE = "tdac: cannot store a secret ("
END = ": jittered starts are drawn for this run only; its report has their seed"
VERIFY = """
import sys
from tdac_agent import load_task
from tdac_agent.verification.verify import verify
if __name__ == "__main__":
    seed = int(sys.argv[2]) if sys.argv[2:] else None
    report = verify(sys.argv[1] + "/controller.py", load_task(sys.argv[1]), seed=seed)
    print(report.provenance.seed, [e.d0 for e in report.episodes])
"""


def python(state, *words, **environment):
    """Starts Python with a user's folder for states."""
    variables = {**os.environ, "XDG_STATE_HOME": str(state), **environment}
    return subprocess.Popen(
        [sys.executable, *map(str, words)],
        env=variables,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


def said(process):
    """What a process wrote, and what it complained of."""
    out, err = process.communicate()
    assert process.returncode == 0, err
    return out, err


@pytest.mark.slow
def test_a_secret_is_made_once(tmp_path):
    """Several processes that start at once agree; the file is for its owner alone."""
    begun = [python(tmp_path / "state", "-c", KEYED) for _ in range(4)]
    outputs = {said(process) for process in begun}
    assert outputs == {said(python(tmp_path / "state", "-c", KEYED))}
    assert {err for _, err in outputs} == {""}
    (file,) = (tmp_path / "state" / "tdac").iterdir()
    assert stat.S_IMODE(file.stat().st_mode) == 0o600
    assert len(file.read_bytes()) == 32


def spoiled_by(kind, file):
    """Makes a place where no secret can be stored, or that has a bad one."""
    file.parent.mkdir(parents=True)
    if kind == "not a folder":
        file.parent.rmdir()
        file.parent.touch()
    elif kind == "a link":
        (file.parent / "other").write_bytes(bytes(32))
        file.symlink_to(file.parent / "other")
    elif kind == "a pipe":
        os.mkfifo(file, 0o600)
    else:
        file.write_bytes(bytes(31 if kind == "too short" else 32))
        file.chmod(0o644 if kind == "for others to read" else 0o600)


@pytest.mark.slow
@pytest.mark.parametrize(
    "kind", ["not a folder", "a link", "a pipe", "too short", "for others to read"]
)
def test_no_place_for_a_secret_is_said(kind, tmp_path):
    """One line; the secret is another one in each process, and nothing is written."""
    file = tmp_path / "state" / "tdac" / "secret"
    spoiled_by(kind, file)
    before = sorted(tmp_path.rglob("*"))
    results = [said(python(tmp_path / "state", "-c", KEYED)) for _ in range(2)]
    assert len({out for out, _ in results}) == 2
    for _, err in results:
        assert err.startswith(f"{LINE}{file}: ")
        assert err.count("\n") == 1
    assert sorted(tmp_path.rglob("*")) == before


@pytest.mark.slow
@pytest.mark.parametrize("shown", exposure().packages + exposure().system[:1])
def test_a_secret_is_kept_from_the_sandbox(shown):
    """A folder that controllers can read is no place for it: said, not made."""
    state = Path(shown) / "state"
    _, err = said(python(state, "-c", KEYED))
    assert err == f"{LINE}controllers can read {state}/tdac/secret){END}\n"
    assert not state.exists()


def test_a_seed_follows_from_controller_task_and_secret(small_task, tmp_path):
    """From each of the three; and it is a number that can be typed."""
    changed = replace(small_task, spec=small_task.spec.model_copy(update={"name": "x"}))
    other = small_task.spec.progress.model_copy(update={"fraction": 0.5})
    harder = replace(
        small_task, spec=small_task.spec.model_copy(update={"progress": other})
    )
    assert seed_of(b"a", small_task) == seed_of(b"a", changed)
    seeds = {
        seed_of(b"a", small_task),
        seed_of(b"a #", small_task),
        seed_of(b"a", harder),
    }
    assert len(seeds) == 3
    assert max(seeds) < 2**32


def test_the_same_file_gets_the_same_verdict(small_task, good_source, warm):
    """On one machine, and anywhere with the seed of its report."""
    first, again = (
        verify(good_source, small_task, profile="policy", judge=warm) for _ in range(2)
    )
    seed = first.provenance.seed
    assert seed == again.provenance.seed == seed_of(good_source.encode(), small_task)
    given = verify(good_source, small_task, profile="policy", seed=seed, judge=warm)
    assert [e.d0 for e in first.episodes] == [e.d0 for e in again.episodes]
    assert [e.d0 for e in first.episodes] == [e.d0 for e in given.episodes]
    starts = spread_starts(small_task.nominal, seed, JITTERS)
    assert starts != spread_starts(small_task.nominal, 0, JITTERS)


@pytest.mark.slow
def test_another_installation_has_other_starts(good, tmp_path):
    """Unless it is given the seed of the first one's report."""
    script = tmp_path / "ask.py"
    script.write_text(VERIFY)
    first, _ = said(python(tmp_path / "one", script, good))
    other, _ = said(python(tmp_path / "two", script, good))
    assert first != other
    assert said(python(tmp_path / "two", script, good, first.split()[0]))[0] == first


@pytest.mark.slow
def test_disturbed_episodes_begin_where_nobody_can_know(small_task, good_source, warm):
    """The seed of the first one is that of the controller, unless it is given."""
    report = verify_episodes(good_source, small_task, 1, judge=warm)
    own = seed_of(good_source.encode(), small_task)
    assert report.provenance.first == own
    given = verify_episodes(good_source, small_task, 1, first=0, judge=warm)
    assert given.provenance.first == 0


@pytest.mark.slow
def test_a_run_tells_the_seeds_and_not_the_secret(small_task, tmp_path, warm):
    """Each candidate has its own, in run.json and in its report."""
    run = synthesize(small_task, out=tmp_path / "run", judge=warm)
    assert run.seed is None
    source = run.controller.read_bytes()
    assert run.attempts[-1].seed == seed_of(source, small_task)
    secret = lasting_secret()
    assert secret is not None
    for path in (tmp_path / "run").rglob("*"):
        content = path.read_bytes() if path.is_file() else b""
        assert secret not in content
        assert secret.hex().encode() not in content.lower()
