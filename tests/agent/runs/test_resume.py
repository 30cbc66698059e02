"""Going on with a run: what is asked again, what is not, and what is refused."""

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
import yaml
from script import NO_RULES, STILL, Script, code
from unconfirmed import synthesize
from without_marks import reading

from tdac_agent import load_task
from tdac_agent.errors import Fault, RunError
from tdac_agent.models.provider import PermanentFault, Reply
from tdac_agent.models.retry import RetryPolicy
from tdac_agent.prompting.prompt import generate_prompt
from tdac_agent.runs.ownership import is_own_folder, mark_anew
from tdac_agent.runs.resume import resume_arguments
from tdac_agent.runs.run_record import load_run
from tdac_agent.storage.journal import read_records
from tdac_agent.storage.locks import LOCK_FILE, hold

AT_ONCE = RetryPolicy(first_wait=0.0)


def events(folder, name):
    records = read_records(folder / "journal.jsonl")
    return [record for record in records if record["event"] == name]


@pytest.fixture(scope="module")
def once_halted(policy_task, tmp_path_factory, warm):
    out = tmp_path_factory.mktemp("halted") / "run"
    model = Script(code(STILL, tokens_in=7), PermanentFault("401 no such key"))
    with pytest.raises(Fault):
        synthesize(policy_task, model, out=out, judge=warm)
    return out


@pytest.fixture
def halted(once_halted, out):
    """A run whose model is gone after one candidate, which stands still."""
    return shutil.copytree(once_halted, out)


@pytest.mark.slow
def test_what_is_on_record_is_not_done_again(policy_task, good_source, halted, warm):
    """Neither asked nor verified; tokens, time and the record go on."""
    before = load_run(halted)
    report = (halted / "iterations/k01/j0/report.json").stat()
    seen = []
    model = Script(code(good_source, tokens_in=3))
    run = synthesize(policy_task, model, out=halted, on_event=seen.append, judge=warm)
    assert model.asked() == [("edit", 1, 1)]
    assert (run.status, run.tau, run.tokens_in) == ("passed", 1, 10)
    assert [(a.k, a.j, a.passed) for a in run.attempts] == [(1, 0, False), (1, 1, True)]
    now = (halted / "iterations/k01/j0/report.json").stat()
    assert (now.st_ino, now.st_mtime_ns) == (report.st_ino, report.st_mtime_ns)
    assert len(events(halted, "verify.end")) == 2
    assert len([record for record in seen if record["event"] == "verify.end"]) == 2
    assert (run.id, run.started) == (before.id, before.started)
    assert run.seconds > before.seconds
    clock = [record["seconds"] for record in read_records(halted / "journal.jsonl")]
    assert clock == sorted(clock)
    assert not run.censored
    assert before.censored


@pytest.mark.slow
def test_a_report_of_other_code_does_not_count(policy_task, good_source, halted, warm):
    """Whoever puts a passing report into the folder has the candidate verified anew."""
    other = halted / "iterations/k01/j0/report.json"
    text = json.loads(other.read_text())
    text["provenance"]["controller_sha256"] = "0" * 64
    text["tests"] = dict.fromkeys(text["tests"], "passed")
    text["failures"] = []
    count = len(text["tests"])
    text["verdict"] = {
        "passed": True,
        "expected": count,
        "passed_tests": count,
        "failed_tests": 0,
    }
    other.write_text(json.dumps(text))
    run = synthesize(policy_task, Script(code(good_source)), out=halted, judge=warm)
    assert [a.passed for a in run.attempts] == [False, True]
    assert not json.loads(other.read_text())["verdict"]["passed"]


@pytest.mark.slow
def test_an_answer_that_is_damaged_is_asked_for_again(
    policy_task, good_source, halted, warm
):
    """The hash tells; what was lost is lost, but never taken for an answer."""
    for blob in (halted / "blobs").iterdir():
        if blob.read_text() == code(STILL).text:
            blob.write_text("```python\nraise\n```")
    model = Script(code(good_source))
    assert synthesize(policy_task, model, out=halted, judge=warm).tau == 1
    assert model.asked() == [("generate", 1, 0)]


@pytest.fixture(scope="module")
def once_verified(policy_task, tmp_path_factory, warm):
    out = tmp_path_factory.mktemp("verified") / "run"
    assert synthesize(policy_task, "builtin", out=out, judge=warm).passed
    return out


def test_a_run_that_has_ended(once_verified, out, tdac, done):
    """Nothing is asked, nothing is written, and it is said."""
    shutil.copytree(once_verified, out)
    before = {path: path.stat().st_mtime_ns for path in out.rglob("*")}
    told = done("synth", "--resume", out)
    assert "has already finished; nothing was done" in " ".join(told.split())
    assert {path: path.stat().st_mtime_ns for path in out.rglob("*")} == before
    record = json.loads((out / "run.json").read_text())
    (out / "run.json").write_text(json.dumps(record | {"status": "not verified"}))
    mark_anew(load_run(out))
    assert tdac("synth", "--resume", out)[0] == 1


def test_a_run_with_pictures_is_shown_but_not_resumed(policy_task, halted, warm):
    """Earlier versions could send pictures, and said in each record whether they did.

    Without them, it is the same run as one of today. With them, it is still one's own
    and says so, but its questions cannot be asked again.
    """
    record = json.loads((halted / "run.json").read_text())
    assert "vision" not in record

    def changed(*, vision):
        text = json.dumps(record | {"vision": vision})
        (halted / "run.json").write_text(text)
        return load_run(halted)

    assert is_own_folder(changed(vision=False))
    model = Script(PermanentFault("401 no such key"))
    with pytest.raises(Fault):
        synthesize(policy_task, model, out=halted, judge=warm)
    assert model.asked() == [("edit", 1, 1)]
    assert not is_own_folder(changed(vision=True))
    mark_anew(load_run(halted))
    kept = json.loads((halted / "run.json").read_text())
    assert kept["vision"]
    assert is_own_folder(load_run(halted))
    assert "a failure, with each question" in reading(halted)
    with pytest.raises(RunError) as caught:
        synthesize(policy_task, Script(), out=halted, judge=warm)
    assert str(caught.value).endswith(
        "contains another run (pictures True instead of False): "
        "give a new folder with --out"
    )


def test_another_run_is_refused(policy_task, small_task, halted, warm):
    """One line names all that differs; the folder stays as it is."""
    before = {path: path.read_bytes() for path in halted.rglob("*") if path.is_file()}
    expected = (
        r"contains another run \(learner script instead of builtin; "
        r"optimizer script instead of builtin; J 1 instead of 2; "
        r"seed none instead of 4"
    )
    with pytest.raises(RunError, match=expected) as caught:
        synthesize(policy_task, "builtin", out=halted, seed=4, patience=2, judge=warm)
    assert "\n" not in str(caught.value)
    with pytest.raises(RunError, match="different first question"):
        synthesize(small_task, Script(), out=halted, judge=warm)
    with pytest.raises(RunError, match="different initial controller"):
        synthesize(policy_task, Script(), out=halted, start_from=STILL, judge=warm)
    after = {path: path.read_bytes() for path in halted.rglob("*") if path.is_file()}
    assert after == before


def test_a_run_on_other_dynamics_is_not_resumed(policy_task, halted, warm):
    """As one of before Ladder 1.0; no option restores them."""
    record = json.loads((halted / "run.json").read_text())
    assert record["dynamics"] == policy_task.dynamics()
    del record["dynamics"]
    (halted / "run.json").write_text(json.dumps(record))
    with pytest.raises(
        RunError, match=r"\(different dynamics\): give a new f.* --out$"
    ):
        synthesize(policy_task, Script(), out=halted, judge=warm)


def test_one_process_at_a_time(policy_task, halted, warm):
    """A run that is being written is left alone."""
    with hold(halted / LOCK_FILE) as mine:
        assert mine
        with pytest.raises(RunError, match="another process is at work on"):
            synthesize(policy_task, Script(), out=halted, judge=warm)


@pytest.mark.slow
def test_the_same_edit_is_not_tested_again(policy_task, good_source, out, warm):
    """Comments and layout are no change; the model is told, and the report stands."""
    same = f"# repaired\n\n{STILL}"
    model = Script(code(STILL), code(same), code(good_source))
    run = synthesize(policy_task, model, out=out, patience=2, judge=warm)
    assert [(a.j, a.unchanged) for a in run.attempts] == [
        *((0, False), (1, True), (2, False))
    ]
    assert run.attempts[1].failed_tests == run.attempts[0].failed_tests
    assert len(events(out, "verify.start")) == 2
    first, second = (request.prompt for request in model.requests[1:])
    assert "The last edit changed nothing" not in first
    assert "The last edit changed nothing" in second
    assert "# repaired" in second
    model = Script(code(STILL), code(same), NO_RULES, code(good_source))
    again = synthesize(policy_task, model, out=out.with_name("other"), judge=warm)
    assert again.tau == 2
    assert "The last edit changed nothing" in model.requests[2].prompt
    assert "changed nothing" not in model.requests[3].prompt


def test_equal_questions_are_different_samples(policy_task, good_source, out, warm):
    """A run that goes on after equal questions gives each of them its own answer."""
    nothing = Reply("No code.")
    model = Script(nothing, nothing, nothing, PermanentFault("gone"))
    with pytest.raises(Fault):
        synthesize(policy_task, model, out=out, judge=warm)
    model = Script(code(good_source))
    run = synthesize(policy_task, model, out=out, judge=warm)
    assert [(a.k, a.valid) for a in run.attempts] == [(1, False), (2, True)]
    (request,) = model.requests
    assert (request.sample[1:], request.turn, request.repeat) == ((2, 0), 0, 1)


TASKS = ["maze", "epuck-maze", "own map"]


@pytest.mark.parametrize("name", TASKS)
def test_a_folder_knows_how_it_was_begun(tmp_path, name, warm):
    """`--resume` needs nothing else: task, models, prompt and all that was given."""
    from tdac_envs.mapping.bundled import bundled_map

    if name == "own map":
        folder = tmp_path / "mine"
        folder.mkdir()
        shutil.copy(bundled_map("office").image, folder / "plan.png")
        start, goal = bundled_map("office").start, bundled_map("office").goal
        spec = {
            "schema": 1,
            "map": "plan.png",
            "start": list(start),
            "goal": list(goal),
        }
        spec["instructions"] = "Keep to the left."
        (folder / "task.yaml").write_text(yaml.safe_dump(spec))
        name = str(folder)
    template = tmp_path / "mine.j2"
    template.write_text("{% include 'underspecified.md.j2' %}\nPlease.\n")
    task = load_task(name)
    wanted = {"iterations": 3, "patience": 2, "seed": 5, "max_output": 99, "index": 0}
    model = Script(PermanentFault("gone"))
    out = tmp_path / "run"
    with pytest.raises(Fault):
        synthesize(
            task,
            model,
            out=out,
            prompt=str(template),
            start_from=None,
            **wanted,
            judge=warm,
        )
    template.unlink()
    known = resume_arguments(out)
    assert {key: known[key] for key in wanted} == wanted
    assert known["problem"].sha256 == task.sha256()
    assert known["problem"].question() == generate_prompt(task, ())
    model = Script(PermanentFault("gone again"))
    with pytest.raises(Fault, match="gone again"):
        synthesize(**{**known, "learner": model, "optimizer": None}, judge=warm)
    assert model.requests[0].prompt.endswith("Please.\n")


def test_resume_takes_no_other_flags(refused, halted):
    """It goes on as it was begun; a folder without a run is one clear line."""
    err = refused("synth", "--resume", halted, "-K", 3, "--out", "x")
    assert "--resume continues a run as it was begun: leave out -K, --out" in err
    err = refused("synth", "--resume", halted, "--learner", "builtin")
    assert "contains another run (learner " in err
    err = refused("synth", "--resume", halted.parent)
    assert "is not a run folder" in err


def test_a_run_that_ended_before_it_had_begun_is_begun_again(refused, halted, tmp_path):
    """Its task is not there yet; the message says what to do."""
    folder = tmp_path / "early"
    folder.mkdir()
    (folder / "run.json").write_bytes((halted / "run.json").read_bytes())
    err = refused("synth", "--resume", folder)
    assert f"repeat its command with --out {folder}" in err


@pytest.mark.slow
def test_a_full_disk_is_one_clear_line(tmp_path, good):
    """Exit 3 before anything is asked; with room again the run goes on."""
    place = tmp_path / "small-disk"
    place.mkdir()
    synth = f"{sys.executable} -m tdac_agent synth --task {good} --out {place}/run"
    script = f"mount -t tmpfs -o size=4m none {place} && {synth}"
    done = subprocess.run(
        ["unshare", "-rm", "sh", "-c", script],
        capture_output=True,
        text=True,
        check=False,
        env={**os.environ, "COLUMNS": "200"},
    )
    if "unshare" in done.stderr or "mount:" in done.stderr:
        pytest.skip("no disk can be made here")
    assert done.returncode == 3
    assert "Traceback" not in done.stderr
    assert "the disk is full: " in done.stderr.splitlines()[-1]


def test_runs_are_listed(tdac, done, halted, once_verified):
    """Whatever else lies there; each with its way on, the torn ones by their reason."""
    place = halted.parent
    shutil.copytree(once_verified, place / "good")
    (place / "torn").mkdir()
    (place / "torn" / "run.json").write_text('{"schema_ver')
    (place / "foreign").mkdir()
    (place / "foreign" / "notes.txt").write_text("mine")
    told = done("runs", place)
    assert "foreign" not in told
    assert f"to continue: tdac synth --resume {halted}" in told
    assert "passed" in told
    told = tdac("runs", place, "--json")[1]
    rows = {Path(row["run"]).name: row for row in json.loads(told)}
    assert {name: row["status"] for name, row in rows.items()} == {
        "run": "fault",
        "good": "passed",
        "torn": "unreadable",
    }
    assert rows["good"]["go_on"] == ""
    assert rows["good"]["cost"] == 0.0
    assert "401 no such key" in rows["run"]["reason"]
    # A process that was killed could not say so, and holds no lock.
    record = json.loads((halted / "run.json").read_text()) | {"status": "running"}
    (halted / "run.json").write_text(json.dumps(record))
    with hold(halted / LOCK_FILE):
        assert json.loads(tdac("runs", halted, "--json")[1])[0]["status"] == "running"
    assert json.loads(tdac("runs", halted, "--json")[1])[0]["status"] == "killed"


def test_no_runs(tdac, refused, tmp_path):
    """An empty folder has none; one that is not there is one clear line."""
    assert "no runs in" in tdac("runs", tmp_path)[1]
    assert tdac("runs")[:2] == (0, "no runs in runs; `tdac synth` makes one\n")
    err = refused("runs", tmp_path / "none")
    assert err.startswith("error: cannot read")
