"""One's own folders need no permission; what is somebody else's needs one each time."""

import json
import os
import py_compile
import shutil
from dataclasses import replace
from pathlib import Path

import pytest
import yaml
from few_worlds import KNOWN, write_set
from small import write_small_task
from unconfirmed import synthesize

from tdac_agent import load_task
from tdac_agent.models.budget import Enough
from tdac_agent.problems.choice import problem_of
from tdac_agent.prompting.prompt import (
    PromptError,
    PromptTemplate,
    generate_prompt,
    load_template,
)
from tdac_agent.runs.ownership import (
    _earlier_facts,
    has_earlier_mark,
    is_own,
    is_own_folder,
    mark_verified,
    sign,
)
from tdac_agent.runs.recorder import Recorder
from tdac_agent.runs.replay import DEMO
from tdac_agent.runs.run_record import load_run
from tdac_agent.studio.run_status import from_elsewhere
from tdac_agent.synthesis.setup import hold_folder
from tdac_agent.tasks.installation import keyed, lasting_secret
from tdac_agent.tasks.task import display_name
from tdac_agent.tasks.task_file import TaskFile
from tdac_agent.tasks.trust import NotTrustedError, tree_sha256
from tdac_agent.verification.verify import verify
from tdac_envs import load_set

TEST = "def test_own(rollout):\n    assert rollout('nominal').reached\n"


@pytest.fixture(scope="module")
def made(tmp_path_factory, warm):
    """A run that was begun here, with tests of one's own."""
    folder = tmp_path_factory.mktemp("own")
    task = load_task(write_small_task(folder / "task", profile="policy"))
    (folder / "tests").mkdir()
    (folder / "tests" / "test_own.py").write_text(TEST)
    task = replace(task, suite=folder / "tests")
    run = synthesize(task, out=folder / "run", iterations=1, judge=warm)
    assert run.passed
    return run.folder


@pytest.fixture(scope="module")
def made_on_set(tmp_path_factory, warm):
    """Such a run on a task set."""
    folder = tmp_path_factory.mktemp("own")
    few = load_set(write_set(folder / "few.yaml"))
    (folder / "tests").mkdir()
    (folder / "tests" / "test_own.py").write_text(TEST)
    given = {"out": folder / "run", "suite": folder / "tests", "judge": warm}
    few_episodes = {"episodes": 2, "feedback_episodes": 1, "start_from": KNOWN}
    run = synthesize(few, "builtin", iterations=1, patience=0, **given, **few_episodes)
    assert run.status == "selected"
    assert run.suite_sha256
    return run.folder


@pytest.fixture
def run_on_set(made_on_set, tmp_path):
    """A copy of it, elsewhere."""
    return Path(shutil.copytree(made_on_set, tmp_path / "elsewhere" / "moved"))


@pytest.fixture
def run(made, tmp_path):
    """A copy of it, elsewhere."""
    return Path(shutil.copytree(made, tmp_path / "elsewhere" / "moved"))


@pytest.fixture
def secret(monkeypatch, tmp_path):
    """Makes this another installation."""

    def change():
        monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "another"))
        lasting_secret.cache_clear()

    yield change
    monkeypatch.undo()
    lasting_secret.cache_clear()


@pytest.mark.slow
def test_own_folders_need_nothing(tdac, run):
    """Verified again and gone on with as it was, wherever it lies; tests are named."""
    code, out, err = tdac("verify", run)
    assert (code, err) == (0, "")
    known = json.loads((run / "report.json").read_text())
    digest = known["provenance"]["own_suite"]
    assert f"with the tests suite ({digest})," in " ".join(out.split())
    assert tdac("synth", "--resume", run)[0] == 0


@pytest.mark.slow
def test_own_folders_on_sets_need_nothing(tdac, run_on_set):
    """Their tests are run again, and gone on with; a foreign one asks."""
    code, out, err = tdac("verify", run_on_set, "-n", 1)
    assert (code, err) == (0, "")
    assert "tests of your own: all 1 passed" in out
    assert tdac("synth", "--resume", run_on_set)[0] == 0
    (run_on_set / "suite" / "test_own.py").write_text("raise SystemExit\n")
    code, out, err = tdac("verify", run_on_set, "-n", 1)
    assert (code, out, err.count("\n")) == (2, "", 1)
    assert f"wants to run the tests in {run_on_set}/suite (sha256" in err


@pytest.mark.slow
@pytest.mark.parametrize("ground", ["run", "run_on_set"])
def test_a_permission_holds_once(tdac, request, ground):
    """`--suite` or `--trust`, which lists what it allows; nothing of it is kept."""
    run = request.getfixturevalue(ground)
    words = ("verify", run, *["-n", 1] * (ground == "run_on_set"))
    test = run / "suite" / "test_own.py"
    test.write_text(f"{TEST}\n\ndef test_more():\n    pass\n")
    before = {p: p.read_bytes() for p in run.rglob("*.*") if p.is_file()}
    refused = tdac(*words)
    assert (refused[0], refused[1]) == (2, "")
    assert refused[2].count("\n") == 1
    short = tree_sha256(run / "suite")[:12]
    wish = f"run the tests in {run}/suite (sha256 {short})"
    assert (
        f"wants to {wish}: allow it with --suite {run}/suite, or with --trust"
        in (refused[2])
    )
    code, _, err = tdac(*words, "--trust")
    assert (code, err) == (0, f"trusted for this command only: {run} may {wish}\n")
    assert tdac(*words, "--suite", run / "suite")[0] == 0
    assert tdac(*words) == refused
    assert {p: p.read_bytes() for p in run.rglob("*.*") if p.is_file()} == before


@pytest.mark.parametrize(
    "change",
    [
        {"learner": "command:true"},
        {"optimizer": "command:true"},
        {"base_url": "http://127.0.0.1:1/v1"},
        {"seed": 0},
        {"max_cost": 1000.0},
        {"mark": ""},
        {"mark": "é"},
        {"mark": "own"},
        {"mark": "2:0:"},
        {"mark": f"2:0:{'0' * 64}"},
        {"mark": f"2:{10**11}:{'0' * 64}"},
        {"id": "0" * 16},
        {"task": "maze"},
        {"task_sha256": "0" * 64},
        {"status": "interrupted"},
        {"tau": 7},
        {"attempts": []},
        {"iterations": 100},
        {"max_tokens": 1},
        {"seconds": 0.0},
        {"cost": None},
        {"enough": Enough(max_tokens=3)},
    ],
    ids=str,
)
def test_a_change_of_its_record_makes_it_foreign(run, change):
    """Whatever is changed: what may run, what it is about, and what it claims."""
    known = load_run(run)
    assert is_own_folder(known)
    assert not is_own_folder(known.model_copy(update=change))


def record_of(folder):
    return json.loads((folder / "run.json").read_text())


def keep_the_mark(run, other):
    """The whole record of one run, with the mark of another."""
    (run / "run.json").write_text(
        json.dumps(record_of(other) | {"mark": record_of(run)["mark"]})
    )


def swap_the_controller(run, other):
    (run / "controller.py").write_text("def policy(obs):\n    return 0.0, 0.0\n")


def remove_the_controller(run, other):
    (run / "controller.py").unlink()


def copy_the_journal(run, other):
    shutil.copy(other / "journal.jsonl", run)
    shutil.copy(other / "run.marks", run)


def edit_the_journal(run, other):
    text = (run / "journal.jsonl").read_text()
    (run / "journal.jsonl").write_text(text.replace('"passed": true', '"passed": 1'))


def add_to_the_journal(run, other):
    with (run / "journal.jsonl").open("a") as file:
        file.write('{"event": "prove.end", "seconds": 1}\n')


def cut_the_journal(run, other):
    lines = (run / "journal.jsonl").read_bytes().splitlines(keepends=True)
    (run / "journal.jsonl").write_bytes(b"".join(lines[:-1]))


def remove_the_journal(run, other):
    (run / "journal.jsonl").unlink()


def end_the_unfinished(run, other):
    """The mark and the status of a finished run on an unfinished one."""
    ended = record_of(run)
    shutil.copytree(other, run, dirs_exist_ok=True)
    (run / "run.json").write_text(
        json.dumps(record_of(other) | {k: ended[k] for k in ("mark", "status", "tau")})
    )


CHANGES = (
    keep_the_mark,
    swap_the_controller,
    remove_the_controller,
    copy_the_journal,
    edit_the_journal,
    add_to_the_journal,
    cut_the_journal,
    remove_the_journal,
    end_the_unfinished,
)


@pytest.fixture(scope="module")
def unfinished(tmp_path_factory, made, warm):
    """A run of this installation that an interrupt ended before its first answer."""

    class Interrupts:
        name = "interrupts"
        paid = False

        def complete(self, request):
            raise KeyboardInterrupt

    task, out = load_task(made / "task.yaml"), tmp_path_factory.mktemp("half") / "run"
    with pytest.raises(KeyboardInterrupt):
        synthesize(task, Interrupts(), out=out, iterations=1, judge=warm)
    return out


@pytest.mark.parametrize("change", CHANGES, ids=lambda change: change.__name__)
def test_a_mark_holds_for_one_run(refused, run, unfinished, change):
    """A copied mark, or other files below it: its verdict is not believed."""
    assert is_own_folder(load_run(unfinished))
    change(run, unfinished)
    assert not is_own_folder(load_run(run))
    if load_run(run).finished:
        err = refused("synth", "--resume", run)
        assert "did not begin, or that was changed since" in err


def test_a_torn_line_does_not_make_it_foreign(unfinished, tmp_path):
    """A process that is killed while it writes leaves a run of this installation."""
    run = Path(shutil.copytree(unfinished, tmp_path / "run"))
    with (run / "journal.jsonl").open("a") as file:
        file.write('{"event": "call.in')
    assert is_own_folder(load_run(run))
    (run / "journal.jsonl").write_bytes((run / "journal.jsonl").read_bytes()[:-19])
    assert is_own_folder(load_run(run))


def test_a_controller_is_replaced_at_any_moment(tmp_path):
    """Killed before or after the file is written, the run is known."""
    before = "x = 1\n"
    begun = load_run(DEMO).model_copy(update={"folder": tmp_path, "mark": ""})
    recorder = Recorder(begun)
    recorder.begin(problem_of(load_task(begun.task)), load_template("full"), None)
    recorder.deliver(before)
    recorder.run.tau = 1
    recorder.save()
    recorder.deliver("x = 2\n")
    assert is_own_folder(load_run(tmp_path))
    (tmp_path / "controller.py").write_text(before)
    assert is_own_folder(load_run(tmp_path))
    (tmp_path / "controller.py").write_text("x = 2\n")
    recorder.save()
    (tmp_path / "controller.py").write_text(before)
    assert not is_own_folder(load_run(tmp_path))


def test_a_report_that_was_changed_is_not_reused(tdac, run, tmp_path):
    """The candidate of an unfinished run is tested again, and fails."""
    recorder = Recorder(load_run(run))
    report = run / "iterations" / "k01" / "j0" / "report.json"
    assert recorder.vouches(report)
    report.write_text(report.read_text().replace('"passed"', '"passed" '))
    assert not recorder.vouches(report)


def with_earlier_mark(run):
    """A run as an earlier version left it: the mark covers what may run."""
    known = load_run(run)
    known.mark = keyed(_earlier_facts(known)).hex()
    (run / "run.marks").unlink()
    (run / "run.json").write_text(known.model_dump_json())
    assert has_earlier_mark(load_run(run))
    return run


@pytest.mark.slow
def test_a_run_of_an_earlier_version_is_marked_anew(tdac, run):
    """One line says how; its tests need a permission until then."""
    with_earlier_mark(run)
    line = f"{run} is marked by an earlier version; `tdac verify {run}` marks it anew"
    assert not is_own_folder(load_run(run))
    assert tdac("synth", "--resume", run) == (2, "", f"error: {line}\n")
    code, _, err = tdac("verify", run, "--trust")
    assert code == 0
    assert err.endswith(f"{run} is marked anew\n")
    assert is_own_folder(load_run(run))
    assert tdac("synth", "--resume", run)[0] == 0


def test_an_earlier_mark_is_no_way_around(tdac, run):
    """A controller that fails marks nothing, nor does one on another task."""
    with_earlier_mark(run)
    swap_the_controller(run, run)
    assert tdac("verify", run, "--trust")[0] == 1
    assert not is_own_folder(load_run(run))
    known = load_run(run)
    same, file = (known.task_sha256, known.profile), run / "controller.py"
    assert mark_verified(file, "0" * 64, known.profile) == ""
    assert mark_verified(file, known.task_sha256, "paper") == ""
    assert mark_verified(run / "other.py", *same) == ""
    assert mark_verified(file, *same) == f"{run} is marked anew"


@pytest.mark.parametrize("file", ["prompt.j2", "suite/conftest.py", "suite/data.json"])
def test_a_new_file_makes_it_foreign(run, file):
    """A template where there was none; anything beside the tests."""
    (run / file).write_text("")
    assert not is_own_folder(load_run(run))


@pytest.mark.parametrize("kind", ["link", "pipe"])
def test_tests_are_plain_files(run, kind):
    """A link could lead elsewhere by the time it is read."""
    odd = run / "suite" / "odd"
    if kind == "link":
        odd.symlink_to(run)
    else:
        os.mkfifo(odd)
    assert tree_sha256(run / "suite") is None
    assert not is_own_folder(load_run(run))
    with pytest.raises(NotTrustedError):
        verify("x = 1\n", load_task(run))


def test_another_installation_does_not_know_it(run, secret):
    """Each has its own secret."""
    secret()
    assert not is_own_folder(load_run(run))
    with pytest.raises(NotTrustedError, match="wants to run the tests"):
        verify(run / "controller.py", load_task(run))


def test_what_was_allowed_stays_somebody_elses(tmp_path, run, secret, warm):
    """A run that goes on with a permission has no mark of this installation."""
    record = json.loads((run / "run.json").read_text())
    record |= {"status": "interrupted", "attempts": []}
    (run / "run.json").write_text(json.dumps(record))
    secret()
    again = synthesize(load_task(run, trust=True), out=run, iterations=1, judge=warm)
    assert again.passed
    assert not is_own(load_run(run), run / "suite")


@pytest.mark.slow
def test_byte_code_beside_tests_is_not_used(tmp_path, small_task, good_source):
    """It need not be what the tests were compiled to, and has no part in their hash."""
    suite, canary = tmp_path / "suite", tmp_path / "canary"
    suite.mkdir()
    test = suite / "test_own.py"
    evil = f"open({str(canary)!r}, 'w')\n\n\ndef test_own():\n    pass\n"
    test.write_text(evil)
    compiled = Path(py_compile.compile(str(test)))
    honest = TEST.ljust(len(evil) - 1, "#") + "\n"
    stamp = test.stat()
    test.write_text(honest)
    os.utime(test, ns=(stamp.st_atime_ns, stamp.st_mtime_ns))
    assert compiled.is_file()
    assert test.stat().st_size == stamp.st_size
    report = verify(good_source, small_task, profile="policy", suite=suite)
    assert report.tests["own/test_own.py::test_own"] == "passed"
    assert not canary.exists()


def test_a_template_computes_nothing(small_task, tmp_path):
    """It is filled in within Jinja's sandbox: one line, and nothing has run."""
    canary = tmp_path / "canary"
    code = f"cycler.__init__.__globals__.os.system('touch {canary}')"
    for text in (f"{{{{ {code} }}}}", "{{ ''.__class__.__mro__ }}"):
        template = PromptTemplate("evil.j2", "{{ rules_block }}" + text)
        with pytest.raises(PromptError, match="unsafe"):
            generate_prompt(small_task, (), template)
    assert not canary.exists()


def test_a_task_is_called_by_what_it_is(tmp_path):
    """Only the bundled maze is called maze and nothing else."""
    assert display_name(load_task("maze")) == "maze"
    empty = load_task(write_small_task(tmp_path / "a", name="maze"))
    digest = empty.setting.world_sha256()[:8]
    tolerance = f"{empty.nominal.goal_tolerance:.0f} px (3.3 radii)"
    about = f"(map {digest}, goal within {tolerance})"
    assert display_name(empty) == f"maze, not the bundled one {about}"
    folder = tmp_path / "b"
    folder.mkdir()
    content = {"schema": 1, "map": "maze", "tolerance": 900.0}
    (folder / "maze.yaml").write_text(yaml.safe_dump(content))
    near = display_name(load_task(folder / "maze.yaml"))
    assert near.startswith("maze, changed (map ")
    assert near.endswith("goal within 900 px (60.0 radii))")


def test_a_bundled_world_has_the_name_of_its_task():
    """`--world maze` is the bundled task `epuck-maze`, not a forged maze."""
    about = {"env": "TDAC-EPuck-v0", "world": "maze"}
    task = load_task(TaskFile.model_validate(about))
    assert display_name(task) == display_name(load_task("epuck-maze")) == "epuck-maze"
    moved = load_task(TaskFile.model_validate({**about, "tolerance": 0.03}))
    assert display_name(moved).startswith("epuck-maze, changed (map ")


def test_the_verdict_names_the_folder(done, good):
    """With the hash of its map and how near the goal has to be come."""
    content = yaml.safe_load((good / "task.yaml").read_text())
    (good / "task.yaml").write_text(yaml.safe_dump({**content, "name": "maze"}))
    words = ("verify", good / "controller.py", "--profile", "policy")
    words = " ".join(done(*words, "--no-confirm").split())
    assert "(task maze, not the bundled one (map " in words
    assert f"px (3.3 radii)) of {good}, profile policy" in words


def test_a_limit_to_go_on_with_is_marked(run):
    """Nobody can raise what a click on Continue may spend."""
    known = load_run(run)
    ended = known.model_copy(update={"enough": Enough(max_cost=0.7)})
    ended.mark = sign(ended, run / "suite")
    assert is_own_folder(ended)
    more = ended.model_copy(update={"enough": Enough(max_cost=700)})
    assert not is_own_folder(more)


class Written:
    """A problem of which only the files matter."""

    file, text = "task.yaml", "name: x\n"

    def __init__(self, write, suite=None):
        self.write_files, self.suite = write, suite

    def write_originals(self, folder):
        pass


def test_a_run_that_begins_is_known(tmp_path):
    """From its first file on; one that was left unfinished by others is not."""
    begun = load_run(DEMO).model_copy(update={"folder": tmp_path, "mark": ""})
    seen = []

    def write(folder):
        seen.append(is_own_folder(load_run(folder)))

    template = load_template("full")
    Recorder(begun).begin(Written(write), template, None)
    assert [*seen, is_own_folder(load_run(tmp_path))] == [True, True]


def test_a_run_that_begins_with_tests_and_a_template_is_known(tmp_path):
    """Its mark holds once they are written; meanwhile it is not called foreign."""
    folder = tmp_path / "run"
    begun = load_run(DEMO).model_copy(update={"folder": folder, "mark": ""})
    seen = []

    def write(_):
        (folder / "suite").mkdir()
        (folder / "suite" / "test_own.py").write_text("")
        seen.append(from_elsewhere(load_run(folder)))

    template = PromptTemplate("mine.j2", "text")
    with hold_folder(folder):
        Recorder(begun).begin(Written(write, folder / "suite"), template, None)
    assert seen == [""]
    assert is_own_folder(load_run(folder))
    for unfinished in ("task.yaml", "prompt.j2"):
        (folder / unfinished).unlink()
    assert from_elsewhere(load_run(folder))
