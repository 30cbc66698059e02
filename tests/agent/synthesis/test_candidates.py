"""`--candidates N`: new controllers side by side, of which the best is repaired."""

import gc
import json
import re
import sys
import threading
from types import SimpleNamespace

import pytest
from script import AHEAD, NO_RULES, STILL, code
from small import write_small_task
from unconfirmed import synthesize
from without_marks import reading

from tdac_agent.errors import RunError
from tdac_agent.metrics import frames_of
from tdac_agent.models.provider import PermanentFault
from tdac_agent.problems.choice import problem_of
from tdac_agent.runs.run_record import load_run
from tdac_agent.synthesis.dialogue import Dialogue
from tdac_agent.synthesis.side_by_side import side_by_side
from tdac_agent.synthesis.workload import whole

RAISES = "def policy(obs):\n    raise ValueError\n"


class Table:
    """A provider with an answer for each place; threads may ask at the same time.

    The first N questions are answered only when all of them have been asked.
    """

    name = "table"
    paid = False
    concurrent = True

    def __init__(self, answers, together):
        self.answers = answers
        self.asked = []
        self.prompts = {}
        self._together = together
        self._meeting = threading.Barrier(together)

    def complete(self, request):
        place = (request.kind, *request.sample[1:])
        self.asked.append(place)
        self.prompts[place] = request.prompt
        if request.kind == "generate" and request.sample[1] <= self._together:
            self._meeting.wait(60)
        answer = self.answers[place]
        if isinstance(answer, BaseException):
            raise answer
        return answer


@pytest.fixture
def ask(write, on_task):
    def run(model, **values):
        return write(on_task, model=model, candidates=3, iterations=6, **values)[1]

    return run


@pytest.mark.slow
def test_the_best_of_three_is_repaired(ask, task, good_source):
    """All are asked at the same time, and each is an iteration."""
    answers = {
        ("generate", 1, 0): code(RAISES),
        ("generate", 2, 0): code(AHEAD),
        ("generate", 3, 0): code(STILL),
        ("edit", 2, 1): code(good_source),
        ("edit", 3, 1): code(good_source),
    }
    model = Table(answers, together=3)
    run = ask(model)
    assert run.passed
    assert sorted(model.asked[:3]) == [("generate", k, 0) for k in (1, 2, 3)]
    (edit,) = model.asked[3:]
    first = [len(a.failed_tests) for a in run.attempts[:3]]
    best = min(range(3), key=lambda n: (first[n], n)) + 1
    assert edit == ("edit", best, 1)
    assert run.tau == best
    prompt = model.prompts[edit]
    others = {1, 2, 3} - {best}
    assert all(f"- k={k} j=0: " in prompt for k in others)
    assert f"- k={best} j=0" not in prompt
    frames = frames_of([run])
    assert frames.runs["done"].tolist() == [3]
    with pytest.raises(RunError, match="number of candidates 3 instead of 1"):
        synthesize(task, model, out=run.folder, iterations=6)


def test_equal_answers_are_tested_once(ask, good_source):
    """Each is an iteration with the result of the first one, and it is said."""
    answers = {
        ("generate", 1, 0): code(STILL),
        ("generate", 2, 0): code(f"# another comment\n{STILL}"),
        ("generate", 3, 0): code(f"{STILL}\n"),
        ("edit", 1, 1): code(good_source),
    }
    model, tested = Table(answers, together=3), []

    def watch(record):
        if record["event"] == "verify.start":
            tested.append((record["k"], record["j"]))

    run = ask(model, on_event=watch)
    assert tested == [(1, 0), (1, 1)]
    first, *others, last = run.attempts
    assert (first.unchanged, first.notes, last.passed) == (False, (), True)
    assert first.failed_tests
    for k, attempt in zip((2, 3), others, strict=True):
        assert (attempt.k, attempt.valid, attempt.unchanged) == (k, True, True)
        assert attempt.notes == ("same code as k=1 j=0",)
        assert attempt.failed_tests == first.failed_tests
        assert f"- k={k} j=0: same code as k=1 j=0" in model.prompts["edit", 1, 1]
    assert frames_of([run]).runs[["tau", "done"]].values.tolist() == [[1, 3]]
    page = reading(run.folder)
    assert page.count("Not tested again: an earlier candidate has the same code") == 2


@pytest.mark.slow
def test_one_of_three_passes_at_once(ask, good_source):
    answers = {("generate", k, 0): code(STILL) for k in (1, 3)}
    answers[("generate", 2, 0)] = code(good_source)
    run = ask(Table(answers, together=3))
    assert run.passed
    assert run.tau == 2
    assert [(a.k, a.passed) for a in run.attempts] == [
        *[(1, False), (2, True), (3, False)]
    ]
    assert (run.folder / "controller.py").read_text() == good_source


@pytest.mark.slow
def test_a_fault_loses_no_answer_of_the_others(ask, good_source):
    """The resumed run asks only what has no answer."""
    answers = {("generate", k, 0): code(STILL) for k in (1, 3)}
    answers[("generate", 2, 0)] = PermanentFault("no access")
    model = Table(answers, together=3)
    with pytest.raises(Exception, match="no access"):
        ask(model)
    again = Table({("generate", 2, 0): code(good_source)}, together=1)
    again.name = model.name
    run = ask(again)
    assert run.passed
    assert again.asked == [("generate", 2, 0)]


@pytest.mark.slow
def test_without_a_success_there_are_all_iterations(ask):
    """K = 6 in two groups; one edit and one summary each."""
    answers = {("generate", k, 0): code(f"{STILL}\nA = {k}\n") for k in range(1, 7)}
    answers |= {("edit", k, 1): code(AHEAD) for k in (1, 4)}
    answers |= {("summarise", k, 1): NO_RULES for k in (1, 4)}
    model = Table(answers, together=3)
    run = ask(model)
    assert run.status == "not verified"
    assert len(model.asked) == 10 == whole(6, 1, candidates=3).questions
    assert frames_of([run]).runs["done"].tolist() == [6]


@pytest.mark.slow
def test_on_a_set_all_drive_on_the_same_worlds(write, on_set, out):
    answers = {
        ("generate", 1, 0): code(STILL),
        ("generate", 2, 0): code(on_set.good),
        ("generate", 3, 0): code(STILL),
    }
    model = Table(answers, together=3)
    _, run = write(on_set, model=model, episodes=16, candidates=3)
    assert run.status == "selected"
    assert run.tau == 2
    worlds = {}
    for path in out.glob("iterations/*/j0/feedback-1/episodes.json"):
        episodes = json.loads(path.read_text())["episodes"]
        worlds[path.parts[-4]] = [episode["index"] for episode in episodes]
    assert worlds["k01"] == worlds["k02"]
    notes = {attempt.k: attempt.notes[-1] for attempt in run.attempts}
    assert notes[2] == "the goal reached in 6 of 6 worlds"
    assert notes[3] == "same code as k=1 j=0"
    assert len(model.asked) == 3


def test_functions_run_at_the_same_time_and_the_first_error_is_raised():
    meeting = threading.Barrier(3)

    def wait(number):
        meeting.wait(60)
        if number:
            raise ValueError(number)
        return number

    with pytest.raises(ValueError, match="1"):
        side_by_side([lambda n=n: wait(n) for n in range(3)])
    assert side_by_side([lambda n=n: n for n in range(9)]) == list(range(9))
    assert side_by_side([]) == []


@pytest.mark.slow
def test_the_command_takes_candidates(tdac, tmp_path):
    folder = write_small_task(tmp_path / "task", profile="policy")
    words = ("synth", "--task", folder, "--candidates", 3, "-K", 6)
    code_, out, err = tdac(*words, "--dry-run", "--json")
    assert (code_, err) == (0, "")
    assert json.loads(out)["questions"] == 6 + 2 * 2
    code_, out, err = tdac(*words, "--out", tmp_path / "run")
    assert (code_, err) == (0, "")
    assert "= k=3 j=0  same code as k=1 j=0" in out
    assert re.search(r"3 │ 0 │ same code +│ same code as k=1 j=0 ", out)
    assert load_run(tmp_path / "run").candidates == 3


@pytest.mark.slow
def test_threads_do_not_parse_at_the_same_time(task):
    """Python 3.11 raises SystemError if a garbage collection lets another one parse."""

    class Calls:
        max_output = 100
        recorder = SimpleNamespace(run=SimpleNamespace(index=0))

        def ask(self, model, request):
            del model, request
            return code(STILL * 100)

    model = SimpleNamespace(name="model", concurrent=True)
    before, interval = gc.get_threshold(), sys.getswitchinterval()

    def collected(phase, info):
        del phase, info
        sum(range(200))

    gc.callbacks.append(collected)
    gc.set_threshold(20)
    sys.setswitchinterval(1e-6)
    try:
        for _ in range(5):
            dialogue = Dialogue(problem_of(task), model, model, Calls())
            answers = dialogue.generate_all(range(1, 9))
            assert all(source == STILL * 100 for source, _ in answers)
    finally:
        gc.callbacks.remove(collected)
        gc.set_threshold(*before)
        sys.setswitchinterval(interval)
