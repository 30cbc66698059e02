"""Job files of somebody else: shown at most, never started, and nobody is stopped."""

import json
import os
import subprocess
import sys

import pytest

pytest.importorskip("nicegui", reason="needs tdac[studio]")

from tdac_agent.studio import jobs as module
from tdac_agent.studio.folder import STATE
from tdac_agent.studio.jobs import (
    JobFile,
    StudioJob,
    free_folder,
    job_of,
    jobs,
    read_job,
    start,
    write_job,
)
from tdac_agent.studio.pages.bench import bench_job, bench_words, progress_of

WORDS = ["bench", "builtin", "--set", "known", "-n", "10"]
FACTS = {
    "words": WORDS,
    "started": "2026-01-01T00:00:00+00:00",
    "pid": 4_000_000,
    "born": "1",
    "about": "bench-1",
    "mark": "",
}


def put(place, content, number="00001"):
    """Writes a job file."""
    file = place / STATE / "jobs" / number / "job.json"
    file.parent.mkdir(parents=True)
    file.write_text(content if isinstance(content, str) else json.dumps(content))
    return file


DAMAGED = {
    "empty": "",
    "no object": "[]",
    "deep": "[" * 100_000,
    "deep words": json.dumps({**FACTS, "words": None}).replace("null", "[" * 9999),
    "huge pid": {**FACTS, "pid": 2**80},
    "pid of nobody": {**FACTS, "pid": 0},
    "pid of the system": {**FACTS, "pid": 1},
    "pid of everybody": {**FACTS, "pid": -1},
    "pid of a group": {**FACTS, "pid": -os.getpid()},
    "pid as a text": {**FACTS, "pid": "x"},
    "no words": {**FACTS, "words": []},
    "words as a text": {**FACTS, "words": "bench"},
    "a word as a list": {**FACTS, "words": [["bench"]]},
    "long words": {**FACTS, "words": ["x" * 5000]},
    "many words": {**FACTS, "words": ["x"] * 2000},
    "no zone": {**FACTS, "started": "2026-01-01T00:00:00"},
    "no date": {**FACTS, "started": "yesterday"},
    "year 0": {**FACTS, "started": "0000-01-01T00:00:00+00:00"},
    "nan": json.dumps({**FACTS, "pid": float("nan")}),
    "digits": json.dumps(FACTS).replace("4000000", "9" * 5000),
    "surrogate": json.dumps({**FACTS, "about": "\ud800"}),
    "missing": {key: FACTS[key] for key in FACTS if key != "born"},
    "more": {**FACTS, "folder": "/etc"},
    "born": {**FACTS, "born": "../1"},
}


@pytest.mark.parametrize("name", DAMAGED)
def test_a_damaged_file_hides_no_other_job(tmp_path, name):
    """It is no job, whatever is in it."""
    put(tmp_path, DAMAGED[name])
    put(tmp_path, FACTS, "00002")
    (found,) = jobs(tmp_path)
    assert found.folder.name == "00002"
    assert free_folder("bench", tmp_path) == "runs/bench-1"


@pytest.mark.parametrize("kind", ["pipe", "folder", "device", "sparse", "circle"])
def test_a_job_file_is_a_small_regular_file(tmp_path, kind):
    """Nothing else is opened for long, or read."""
    file = put(tmp_path, "")
    file.unlink()
    if kind == "pipe":
        os.mkfifo(file)
    elif kind == "folder":
        file.mkdir()
    elif kind == "device":
        file.symlink_to("/dev/zero")
    elif kind == "sparse":
        file.touch()
        os.truncate(file, 8 << 30)
    else:
        file.symlink_to("job.json")
    assert jobs(tmp_path) == []


def test_an_unprintable_command_is_shown_without_what_it_would_draw(tmp_path):
    """No control character, and none that changes the direction of writing."""
    put(tmp_path, {**FACTS, "words": ["bench", "\0\x1b[2J\u202e"]})
    (job,) = jobs(tmp_path)
    assert job.command.isprintable()


@pytest.mark.parametrize(
    "words",
    [
        ["bench"],
        ["bench", "--set"],
        ["bench", "builtin", "-n", "3", "--set"],
        ["bench", "builtin", "--set", "known", "-n"],
        ["bench", "builtin", "--set", "known", "-n", "many"],
        ["bench", "builtin", "--set", "known", "-n", "-3"],
        ["bench", "builtin", "--set", "known", "-n", "9" * 4000],
        ["bench", "--set", "known", "-n", "3"],
        ["verify", "--tier", "rlimits"],
    ],
    ids=" ".join,
)
def test_a_command_that_no_form_wrote_is_no_bench(tmp_path, words):
    """The pages of benches show it nowhere."""
    put(tmp_path, {**FACTS, "words": words})
    (job,) = jobs(tmp_path)
    assert bench_words(job) == ""
    assert bench_job(tmp_path, "bench-1") is None


def test_a_bench_from_elsewhere_is_only_shown(tmp_path):
    """Its command is, with what was driven; it does not run."""
    put(tmp_path, FACTS)
    job = bench_job(tmp_path, "bench-1")
    assert (job.ours, job.running, job.code) == (False, False, None)
    assert bench_words(job) == "builtin on known"
    assert progress_of(job, tmp_path) == (0.0, "0 of 10 episodes driven")


@pytest.fixture
def victim():
    """A process that leads a group and was not started by a studio."""
    words = [sys.executable, "-I", "-S", "-c", "input()"]
    with subprocess.Popen(
        words, stdin=subprocess.PIPE, start_new_session=True
    ) as process:
        yield process
        process.communicate(b"\n")
    assert process.returncode == 0


def test_a_forged_job_stops_nobody(tmp_path, victim):
    """Neither with a mark of another job, nor without one."""
    facts = {**FACTS, "pid": victim.pid, "born": module._born(victim.pid)}
    put(tmp_path, facts)
    job = start(tmp_path, ["--version"], "x")
    mark = json.loads((job.folder / "job.json").read_text())["mark"]
    put(tmp_path, {**facts, "mark": mark}, "00009")
    forged = [each for each in jobs(tmp_path) if each.file.pid == victim.pid]
    assert [each.ours for each in forged] == [False, False]
    for each in forged:
        each.stop()
    assert victim.poll() is None
    wait(job)


def wait(job):
    for process in list(module._STARTED):
        process.wait()
    assert not job.running


@pytest.mark.parametrize("pid", [0, 1, -1, "own", "parent's"])
def test_no_group_but_that_of_a_job_is_interrupted(tmp_path, monkeypatch, pid):
    """Whatever a job says: 0 is our own group, 1 the system's, -1 everybody."""
    sent = []
    monkeypatch.setattr(os, "killpg", lambda *told: sent.append(told))
    named = {"own": os.getpgrp(), "parent's": os.getppid()}
    number = named.get(pid, pid)
    if pid == "parent's" and os.getpgid(number) == number != os.getpgrp():
        pytest.skip("the parent leads a group, as a job does")
    facts = {**FACTS, "pid": number, "born": module._born(number)}
    StudioJob(tmp_path, JobFile.model_construct(**facts), ours=True).stop()
    assert sent == []


@pytest.mark.parametrize("change", ["words", "about", "pid", "born", "started", "mark"])
def test_a_changed_job_is_not_ours(tmp_path, change):
    """Its mark covers everything in it."""
    file = put(tmp_path, "")
    write_job(file, JobFile.model_validate(FACTS))
    assert read_job(file).is_ours(file)
    other = {"words": ["verify"], "pid": 7, "started": "2026-01-02T00:00:00+00:00"}
    facts = json.loads(file.read_text())
    file.write_text(json.dumps({**facts, change: other.get(change, "2")}))
    (job,) = jobs(tmp_path)
    assert not job.ours


@pytest.mark.parametrize("way", ["copied", "link to the file", "link to the folder"])
def test_a_job_of_another_folder_is_not_ours(tmp_path, way):
    """Its words would name other files here."""
    file = put(tmp_path / "there", "")
    write_job(file, JobFile.model_validate(FACTS))
    here = tmp_path / "here"
    at = here / STATE / "jobs" / "00001"
    at.parent.mkdir(parents=True)
    if way == "link to the folder":
        at.symlink_to(file.parent)
    else:
        at.mkdir()
        if way == "copied":
            (at / "job.json").write_bytes(file.read_bytes())
        else:
            (at / "job.json").symlink_to(file)
    assert [job.ours for job in jobs(tmp_path / "there")] == [True]
    assert [job.ours for job in jobs(here)] == [False]


def test_a_job_is_ours_in_a_later_studio(tmp_path):
    """As long as it is where it was begun; the same words start it but once."""
    job = start(tmp_path, ["--version"], "x")
    module._read.cache_clear()
    assert job_of(tmp_path, "x") == job
    assert job.ours
    wait(job)


def test_a_job_from_elsewhere_hides_none_of_ours(tmp_path):
    """Though it claims to be newer, and to work on the same."""
    job = start(tmp_path, ["--version"], "bench-1")
    put(tmp_path, {**FACTS, "started": "2999-01-01T00:00:00+00:00"}, "00002")
    assert job_of(tmp_path, "bench-1") == job
    wait(job)


@pytest.mark.parametrize("words", [["x" * 5000], ["x"] * 2000, []])
def test_what_cannot_be_recorded_is_not_started(tmp_path, words):
    """Nobody could find or stop it; the pages show an OSError."""
    with pytest.raises(OSError, match="words") as caught:
        start(tmp_path, words, "x")
    assert "\n" not in caught.value.strerror
    assert list(tmp_path.iterdir()) == []


def test_the_end_of_a_long_output_is_shown(tmp_path):
    """However much was printed before."""
    file = put(tmp_path, FACTS)
    (file.parent / "output.txt").write_bytes(b"\xc3\xa4" * (1 << 20) + b"the end")
    (job,) = jobs(tmp_path)
    assert job.output().endswith("\u00e4the end")
    assert len(job.output()) == module.TAIL
