"""A race on a task set: who drives, what is asked, what comes of it."""

import json

import pytest
from few_worlds import quick, write_wide_set
from script import NO_RULES, STILL, Paid, Script, code
from subject import Subject

from tdac_agent.errors import RunError
from tdac_agent.models.provider import Reply
from tdac_agent.runs.falsification import read_falsification
from tdac_agent.runs.resume import check_same, settings_of
from tdac_agent.runs.run_record import load_run
from tdac_agent.runs.selection_record import read_selection
from tdac_agent.synthesis.options import SynthOptions
from tdac_agent.synthesis.question_kinds import ASKED, KINDS
from tdac_agent.synthesis.settled import settled
from tdac_envs import load_set
from tdac_envs.core.errors import TaskError

SLOW, FAST, SLOWER = (quick(GAIN=gain) for gain in (0.6, 1.0, 0.4))
ODD, EVEN = quick(HALF=0), quick(HALF=1)
REFUSED = f"import subprocess\n{FAST}"
SMALL = {"search": "race", "seed": 3, "episodes": 32, "iterations": 4, "candidates": 1}
TABLE = "\n| world | least s |"


@pytest.fixture
def wide(tmp_path):
    """A set that `quick` solves."""
    return Subject(load_set(write_wide_set(tmp_path / "wide.yaml")), FAST, SMALL)


@pytest.fixture
def race(write, wide):
    """Runs a race with prepared answers; returns the model and the run."""
    return lambda *sources, **values: write(wide, *map(code, sources), **values)


def facts(run):
    """What the record says of each answer."""
    return [(each.k, each.asked, each.parent, each.merged) for each in run.attempts]


def prompts(model):
    return [request.prompt for request in model.requests]


@pytest.mark.slow
def test_repairs(race, out):
    """A worse child stays a child, and its diff is in the next question."""
    model, run = race(SLOW, SLOWER, FAST, SLOW, ask="repair")
    assert run.status == "selected"
    assert model.asked() == [("generate", 1, 0)] + [
        ("improve", k, 0) for k in (2, 3, 4)
    ]
    assert facts(run) == [
        (1, "fresh", None, None),
        (2, "repair", (1, 0), None),
        (3, "repair", (1, 0), None),
        (4, "repair", (3, 0), None),
    ]
    _first, second, third, last = prompts(model)
    assert "GAIN = 0.6" in second
    assert TABLE in second
    assert "What was tried" not in second
    assert "```diff\n-GAIN = 0.6\n+GAIN = 0.4\n```" in third
    assert "\nGAIN = 1.0\n" in last
    notes = [each.notes[-1] for each in run.attempts]
    assert notes[0].startswith("time score 0.")
    assert ", -0." in notes[1]
    assert "from k=1 j=0; the goal reached in " in notes[1]
    assert ", +0." in notes[2]
    assert notes[3] == "same code as k=1 j=0"
    record = json.loads((out / "run.json").read_text())
    assert (record["search"], record["ask"]) == ("race", "repair")
    assert [each["asked"] for each in record["attempts"]][1:] == ["repair"] * 3
    assert [each["parent"] for each in record["attempts"]][1] == [1, 0]
    folders = {
        path.parent.name for path in out.glob("iterations/k03/j0/*/episodes.json")
    }
    assert folders == {"improve-1", "validation-1", "validation-3", "comparison-1"}
    diff = (out / "iterations/k03/j0/controller.diff").read_text()
    assert "-GAIN = 0.6" in diff


@pytest.mark.slow
def test_the_selection_has_a_comparison_with_the_best_first_answer(race, out):
    """On worlds that decided nothing; all purposes together have the episodes."""
    _, run = race(SLOWER, SLOW, FAST, FAST, ask="repair", candidates=2)
    best = read_selection(out)
    assert (out / "controller.py").read_text() == FAST
    found = best.improvement
    assert (best.k, found.k, found.variations, found.worlds) == (3, 2, 1, 4)
    assert found.low < found.after - found.before < found.high
    assert found.after > found.before
    assert best.optimistic.time > 0.5
    assert best.feedback_used == 0
    assert best.used <= 32
    assert run.tau == 3
    numbers = {
        path.parent.name.partition("-")[0]: []
        for path in out.glob("iterations/*/*/*/episodes.json")
    }
    for path in out.glob("iterations/*/*/*/episodes.json"):
        rows = json.loads(path.read_text())["episodes"]
        numbers[path.parent.name.partition("-")[0]].append({e["index"] for e in rows})
    assert set(numbers) == {"improve", "validation", "comparison"}
    for name in ("improve", "comparison"):  # all drove on the same ones
        assert all(each == numbers[name][0] for each in numbers[name])
    sets = [set.union(*each) for each in numbers.values()]
    assert sum(map(len, sets)) == len(set.union(*sets))


@pytest.mark.slow
def test_the_smallest_failure_of_the_best_one_is_told(race, out):
    """Each best one is searched once, in worlds of the pool that it passed."""
    model, run = race(SLOW, FAST, SLOWER, SLOW, ask="informed,repair", envelope=16)
    assert run.status == "selected"
    first, *others = prompts(model)
    assert "carries" not in first
    best = ["1", "2", "2"]
    for prompt, name in zip(others, best, strict=True):
        told = prompt.partition(f"### How far candidate {name} carries\n")[2]
        assert "there may be smaller failures.\n- " in told
        assert ("smallest failure found in world" in told) or ("no failure" in told)
    pool = {
        row["index"]
        for path in out.glob("iterations/k01/j0/improve-*/episodes.json")
        for row in json.loads(path.read_text())["episodes"]
    }
    folders = sorted(out.glob("iterations/*/j0/envelope"))
    assert [each.parent.parent.name for each in folders] == ["k01", "k02"]
    for folder in folders:
        found = read_falsification(folder)
        assert found.episodes <= found.budget == 16
        assert len(found.envelopes) == 1  # too few episodes for two worlds
        assert {each.number for each in found.envelopes} <= pool


@pytest.mark.slow
def test_a_search_on_record_is_not_made_again(wide, out, write):
    """After an interruption, the same questions follow."""

    def stop(record):
        if record["event"] == "verify.end" and record["k"] == 2:
            raise KeyboardInterrupt

    options = {"ask": "informed", "envelope": 16, "iterations": 3}
    sources = [*map(code, (SLOW, FAST, SLOWER))]
    with pytest.raises(KeyboardInterrupt):
        write(wide, *sources, on_event=stop, **options)
    file = out / "iterations/k01/j0/envelope/falsify.json"
    before = file.read_bytes(), file.stat().st_mtime_ns
    model, run = write(wide, *sources[2:], **options)
    assert run.finished
    assert (file.read_bytes(), file.stat().st_mtime_ns) == before
    assert "### How far candidate 2 carries" in model.requests[-1].prompt
    assert settings_of(run)["envelope"] == 16


@pytest.mark.slow
def test_informed_questions(race):
    """They tell figures, failed tests and repeated code, but no code."""
    model, run = race(SLOW, REFUSED, FAST, FAST, ask="informed")
    assert model.asked() == [("generate", k, 0) for k in (1, 2, 3, 4)]
    assert facts(run)[1:] == [(k, "informed", None, None) for k in (2, 3, 4)]
    first, second, third, last = prompts(model)
    known = [each.partition("What is known from earlier controllers")[2] for each in
             (second, third, last)]  # fmt: skip
    assert all(each.startswith(first.rstrip("\n")) for each in (second, third, last))
    assert not any("GAIN" in each or "def policy" in each for each in known)
    assert "1 controller was written" in known[0]
    assert "2 controllers were written" in known[1]
    assert "### Candidate 2 failed tests, and did not drive" not in known[0]
    for text in known[1:]:
        assert "### Candidate 2 failed tests, and did not drive" in text
        assert "subprocess" in text.partition("### Candidate 2")[2]
    assert TABLE in known[0]
    assert "a command acts in the same step" in known[0]
    assert "### The best one, candidate 3" in known[2]
    assert not run.attempts[1].passed
    assert run.attempts[1].failed_tests
    assert (run.attempts[3].unchanged, run.attempts[3].notes[-1]) == (
        True,
        "same code as k=3 j=0",
    )


@pytest.mark.slow
def test_a_merge(race):
    """Of two that are good in different worlds, and both are shown."""
    model, run = race(ODD, EVEN, FAST, ask="merge", candidates=2, iterations=3)
    assert model.asked()[2] == ("improve", 3, 0)
    k, kind, parent, merged = facts(run)[2]
    assert (k, kind, {parent, merged}) == (3, "merge", {(1, 0), (2, 0)})
    prompt = prompts(model)[2]
    assert "HALF = 0" in prompt
    assert "HALF = 1" in prompt
    assert "combine the ideas, not the files" in prompt
    assert ", +0." in run.attempts[2].notes[-1]


@pytest.mark.slow
def test_without_partners_no_merge_is_asked_for(race):
    """Two that are good in the same worlds have nothing to combine."""
    _, run = race(SLOW, FAST, SLOWER, ask="merge", candidates=2, iterations=3)
    assert facts(run)[2] == (3, "fresh", None, None)
    assert run.status == "selected"


@pytest.mark.slow
def test_faster(race):
    """The best one is to be faster, also if it is not the latest."""
    model, run = race(FAST, SLOW, SLOWER, ask="faster", candidates=2, iterations=3)
    assert facts(run)[2] == (3, "faster", (1, 0), None)
    assert "Save time where it is lost" in prompts(model)[2]


@pytest.mark.slow
def test_fresh_and_rules(race, write, wide):
    """The first question again; or rules of what is known, which stand in it."""
    model, run = race(SLOW, FAST, ask="fresh", iterations=2)
    assert facts(run)[1] == (2, "fresh", None, None)
    assert prompts(model)[0] == prompts(model)[1]
    rule = '```json\n[{"op": "add", "scope": "task", "text": "Do move."}]\n```'
    model, run = write(
        wide, code(SLOW), Reply(rule), code(FAST), NO_RULES, code(STILL),
        ask="rules", iterations=3, out=run.folder.parent / "rules",
    )  # fmt: skip
    assert model.asked() == [
        ("generate", 1, 0),
        *(("summarise", 2, 0), ("generate", 2, 0)),
        *(("summarise", 3, 0), ("generate", 3, 0)),
    ]
    assert facts(run)[1:] == [(k, "rules", None, None) for k in (2, 3)]
    assert TABLE in prompts(model)[1]
    assert "Do move." in prompts(model)[2]


@pytest.mark.slow
def test_one_that_is_clearly_worse_stops_early(race, out):
    """After eight of the ten worlds of the pool; the model is told of both."""
    few = {"episodes": 80, "iterations": 3, "candidates": 1}
    model, run = race(FAST, STILL, SLOWER, ask="repair", **few)
    note = "dropped after 8 episodes, since it was worse than k=1 j=0"
    assert run.attempts[1].notes[-1] == note
    names = sorted(path.name for path in out.glob("iterations/k0*/j0/improve-*"))
    assert names == ["improve-1", "improve-1", "improve-1", "improve-9"]
    assert not (out / "iterations/k02/j0/improve-9").exists()
    tried = prompts(model)[2].partition("### What was tried with it")[2]
    assert "in 8 episodes; lost more or less by failure +1.000" in tried
    assert not (out / "iterations/k02/j0/validation-1").exists()


@pytest.mark.slow
def test_the_same_code_again_and_again(race):
    """All calls are made; what drove is selected all the same."""
    model, run = race(SLOW, SLOW, REFUSED, SLOW, SLOW, ask="repair", iterations=5)
    assert len(model.requests) == 5
    unchanged = [each.unchanged for each in run.attempts]
    assert unchanged == [False, True, False, True, True]
    assert run.status == "selected"
    assert read_selection(run.folder).improvement.worlds == 0  # nothing was better


@pytest.mark.slow
def test_what_drives_show_of_the_robot(race):
    """A measured question tells that alone."""
    model, run = race(SLOW, FAST, ask="measured", iterations=2)
    assert facts(run)[1] == (2, "measured", None, None)
    known = prompts(model)[1].partition("What is known from earlier controllers")[2]
    assert "command (1, 1) drives" in known
    assert "candidate 1" not in known
    assert TABLE not in known


@pytest.mark.slow
def test_without_a_controller_to_ask_about(race):
    """The first question is asked again."""
    model, run = race(REFUSED, FAST, SLOW, ask="repair", iterations=3)
    assert [each.asked for each in run.attempts] == ["fresh", "fresh", "repair"]
    assert prompts(model)[0] == prompts(model)[1]
    assert (run.folder / "controller.py").read_text() == FAST


@pytest.mark.slow
def test_an_answer_without_code(write, wide):
    """It is recorded with its kind, and the race goes on."""
    nothing = [Reply("I cannot.")] * 3
    _model, run = write(
        wide, code(SLOW), *nothing, code(FAST), ask="repair", iterations=3
    )
    assert [each.valid for each in run.attempts] == [True, False, True]
    assert facts(run)[1] == (2, "repair", (1, 0), None)
    assert run.status == "selected"


@pytest.mark.slow
def test_the_end_of_the_budget_ends_the_race_with_what_there_is(write, wide):
    """What drove so far is selected."""
    model = Paid(code(SLOW))
    _, run = write(wide, model=model, max_tokens=30_000, ask="repair")
    assert (run.status, len(model.requests)) == ("selected", 1)
    assert "tokens" in run.reason
    assert read_selection(run.folder).stopped == run.reason


@pytest.mark.slow
def test_a_given_controller_is_the_first_answer(write, wide):
    """It drives as the others do."""
    model, run = write(wide, code(FAST), start_from=SLOW, candidates=2, iterations=2)
    assert facts(run) == [(1, "given", None, None), (2, "fresh", None, None)]
    assert model.asked() == [("generate", 2, 0)]
    assert (run.folder / "controller.py").read_text() == FAST


@pytest.mark.slow
def test_few_episodes(race, out):
    """Only as many first answers are asked for as can drive."""
    model, run = race(SLOW, FAST, SLOW, SLOW, episodes=2, candidates=4)
    assert (len(model.requests), run.status) == (2, "selected")
    assert (out / "controller.py").read_text() == FAST
    assert read_selection(out).used == 2


def test_a_race_in_which_nothing_drives(race):
    """No controller is selected, and the reason says why."""
    _, run = race(REFUSED, candidates=1, iterations=1)
    assert run.status == "not verified"
    assert "static and contract tests" in run.reason


def final_state(run):
    """What a run says of its result, and its controllers."""
    best = read_selection(run.folder)
    files = {
        str(path.relative_to(run.folder)): path.read_bytes()
        for path in run.folder.rglob("*")
        if path.name.startswith("controller.") or path.name.endswith(".prompt.md")
    }
    return run.status, run.attempts, best, files


@pytest.mark.slow
def test_an_interrupted_race_goes_on_the_same_way(race, write, wide, tmp_path):
    """After a break in a drive and one in an answer; and a replay gives the same."""
    answers = [ODD, SLOW, FAST, SLOWER, EVEN, STILL]
    words = {"candidates": 2, "iterations": 6, "episodes": 64}
    model, whole = race(*answers, out=tmp_path / "a", **words)

    def stop(record):
        if record["event"] == "drive.end" and record["k"] == 3:
            raise KeyboardInterrupt

    broken = {"out": tmp_path / "b", **words}
    for script in (
        [*map(code, answers[:3])],
        [code(answers[3]), KeyboardInterrupt()],
    ):
        with pytest.raises(KeyboardInterrupt):
            write(wide, *script, on_event=stop if len(script) == 3 else None, **broken)
    assert load_run(tmp_path / "b").status == "interrupted"
    rest, resumed = race(*answers[4:], **broken)
    assert final_state(resumed) == final_state(whole)
    assert [*prompts(rest)] == prompts(model)[4:]
    replay = f"replay:{tmp_path / 'a'}"
    _, again = write(wide, model=replay, out=tmp_path / "c", **words)
    assert final_state(again) == final_state(whole)
    assert len({each.asked for each in whole.attempts}) > 1


@pytest.mark.slow
def test_the_built_in_learner_gives_the_same_bytes_twice(write, wide, tmp_path):
    """It has one controller, so that the race ends soon."""
    runs = [
        write(wide, model="builtin", episodes=8, out=tmp_path / name)[1]
        for name in ("a", "b")
    ]
    assert final_state(runs[0]) == final_state(runs[1])
    texts = [(each.folder / "report.json").read_bytes() for each in runs]
    assert texts[0] == texts[1]
    assert runs[0].status == "selected"


def test_the_search_tells_runs_apart(race, write, wide):
    """A record without a search is one of the loop of the paper."""
    _, run = race(REFUSED, iterations=1)
    with pytest.raises(RunError, match="different search"):
        write(wide, search="paper", iterations=1)
    with pytest.raises(RunError, match="different kinds of questions"):
        write(wide, ask="repair", iterations=1)
    assert settings_of(run)["search"] == "race"
    assert settings_of(run)["ask"] == ",".join(ASKED)
    old = run.model_copy(update={"search": "", "ask": ""})
    assert settings_of(old)["search"] == "paper"
    assert "ask" not in settings_of(old)
    check_same(old, run.model_copy(update={"search": "paper"}))
    with pytest.raises(RunError, match="different search"):
        check_same(old, run)


def test_defaults_of_the_searches():
    """They depend on the search, which depends on the problem."""
    on_set, on_task = (settled(SynthOptions(), on_set=each) for each in (True, False))
    assert (on_set.search, on_task.search) == ("race", "paper")
    assert (on_set.iterations, on_set.candidates, on_set.episodes) == (8, 4, 512)
    assert (on_task.iterations, on_task.candidates, on_task.episodes) == (20, 1, 128)
    given = SynthOptions(search="paper", iterations=3, ask=" repair ,merge,repair")
    loop = settled(given, on_set=True)
    assert (loop.iterations, loop.candidates, loop.ask) == (3, 1, "repair,merge")


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"search": "rase"}, "search to be one of 'paper', 'race', got 'rase'"),
        ({"ask": "repair,speed"}, "ask to be one of .*, got 'speed'"),
        ({"ask": " , "}, "ask: expected a kind of question"),
        ({"search": "paper", "improve": 32, "ask": "rules"}, "rules are for a race"),
        ({"improve": 32}, "improve: a race goes on after a success anyway"),
    ],
)
def test_what_a_race_cannot_have(write, wide, out, values, message):
    with pytest.raises(TaskError, match=message):
        write(wide, model=Script(), **values)
    assert not out.exists()


@pytest.mark.parametrize(
    ("words", "questions"), [((), 8), (("--ask", "rules", "-K", "6"), 6 + 2)]
)
def test_a_dry_run_says_how_many_questions_there_are(tdac, words, questions):
    """Of a question for rules, two are asked: the rules, and the controller."""
    dry = ("synth", "--set", "known", "--dry-run", "--learner", "anthropic:claude-x")
    code, out, _ = tdac(*dry, *words, "--json")
    assert code == 0
    assert json.loads(out)["questions"] == questions
    said = f"whole run: at most {questions} questions (K={words[-1] if words else 8})"
    assert said in tdac(*dry, *words)[2]


def test_a_race_on_a_task_needs_episodes(write, on_task, out):
    with pytest.raises(TaskError, match="a race on a task needs --improve N"):
        write(on_task, model=Script(), search="race")
    assert not out.exists()


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("--set", "known", "--search", "rase"), "search"),
        (("--set", "known", "--ask", "repair,speed"), "ask"),
        (("--set", "known", "--improve", "32"), "improve: a race goes on"),
        (("--search", "race"), "--improve N"),
    ],
)
def test_mistakes_are_one_line(refused, words, message):
    """Kinds and searches that there are not are named, with those that there are."""
    err = refused("synth", *words)
    assert message in err
    assert ("expected" in err) == (message in {"search", "ask"})
    if message == "ask":
        assert all(kind in err for kind in KINDS)
