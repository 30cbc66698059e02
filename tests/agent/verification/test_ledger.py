"""The ledger of hidden evaluations: nothing is lost, and each is counted once."""

import json

import pytest

from tdac_agent.verification.episode_report import EpisodeProvenance, EpisodeReport
from tdac_agent.verification.ledger import HiddenEvaluation, Ledger, user_ledger
from tdac_envs.core.errors import TaskError


def evaluation(**values):
    given = {"entrant": "e" * 64, "set": "unknown", "set_sha256": "5" * 64}
    return HiddenEvaluation(**given | {"worlds": 100, "salt_sha256": "a" * 64} | values)


def report(worlds=100, **values):
    about = EpisodeProvenance(
        set="unknown",
        set_sha256="5" * 64,
        split="hidden",
        salt_sha256="a" * 64,
        controller_sha256="e" * 64,
        sandbox="bubblewrap",
        limits={},
        versions={},
    )
    given = {"worlds": worlds, "successes": 0, "interval": None, "scores": None}
    given |= {"by_generator": {}, "causes": {}, "told": (), "episodes": ()}
    given |= {"child_cpu_seconds": 1.0, "seconds": 2.0}
    return EpisodeReport(provenance=about, **given | values)


@pytest.fixture
def ledger(tmp_path):
    return Ledger(tmp_path / "new" / "hidden.jsonl")


def driven(ledger, about):
    return ledger.end(ledger.begin(about), about, report())


def test_a_report_is_given_back(ledger):
    """With the time at which it was recorded, and its number."""
    about = evaluation()
    assert ledger.recorded(about) is None
    first = driven(ledger, about)
    assert (first.hidden.number, first.hidden.count) == (1, 1)
    found = Ledger(ledger.path).recorded(about)
    assert found.hidden.recorded is not None
    assert found.model_copy(update={"hidden": None}) == report()


@pytest.mark.parametrize(
    "other",
    [
        {"worlds": 101},
        {"worlds": "sequential"},
        {"salt_sha256": "b" * 64},
        {"set_sha256": "6" * 64},
        {"dynamics": "7" * 64},
    ],
)
def test_what_is_evaluated_again(ledger, other):
    """Another number, salt, version or dynamics is another evaluation of the file."""
    driven(ledger, evaluation())
    assert ledger.recorded(evaluation(**other)) is None
    second = driven(ledger, evaluation(**other))
    assert (second.hidden.number, second.hidden.count) == (2, 2)
    assert ledger.recorded(evaluation()).hidden.number == 1
    assert ledger.recorded(evaluation()).hidden.count == 2


def test_lines_of_before_ladder_1_0_answer_nothing(ledger):
    """They have no dynamics; they are read, and counted."""
    driven(ledger, evaluation())
    lines = [json.loads(line) for line in ledger.path.read_bytes().splitlines()]
    del lines[0]["about"]["dynamics"]
    ledger.path.write_text("".join(f"{json.dumps(line)}\n" for line in lines))
    now = evaluation(dynamics="7" * 64)
    assert ledger.recorded(now) is None
    assert driven(ledger, now).hidden.count == 2
    assert ledger.recorded(evaluation()).hidden.count == 2


@pytest.mark.parametrize("other", [{"entrant": "f" * 64}, {"set": "known"}])
def test_others_are_counted_apart(ledger, other):
    driven(ledger, evaluation())
    assert driven(ledger, evaluation(**other)).hidden.count == 1


def test_controllers_of_one_run_are_counted_together(ledger):
    """Each shows how often hidden worlds have judged what its run wrote."""
    first, second = evaluation(), evaluation(entrant="f" * 64)
    ledger.end(ledger.begin(first, "one run"), first, report())
    found = ledger.end(ledger.begin(second, "one run"), second, report())
    assert (found.hidden.count, found.hidden.lineage) == (1, 2)
    assert ledger.recorded(first).hidden.lineage == 2
    other = evaluation(entrant="d" * 64)
    assert driven(ledger, other).hidden.lineage is None


def test_lines_are_only_appended(ledger):
    driven(ledger, evaluation())
    before = ledger.path.read_bytes()
    driven(ledger, evaluation(worlds=7))
    after = ledger.path.read_bytes()
    assert after.startswith(before)
    lines = [json.loads(line) for line in after.splitlines()]
    assert [each["event"] for each in lines] == ["begun", "ended"] * 2


def test_an_evaluation_that_was_interrupted_counts_once(ledger):
    """It has begun, so its worlds may have been seen; it can be driven to its end."""
    ledger.begin(evaluation())
    assert ledger.recorded(evaluation()) is None
    other = driven(ledger, evaluation(worlds=7))
    assert (other.hidden.number, other.hidden.count) == (2, 2)
    assert driven(ledger, evaluation()).hidden.number == 1


def test_a_torn_line_costs_no_other(ledger):
    """As after a power cut in the middle of a write."""
    driven(ledger, evaluation())
    whole = ledger.path.read_bytes()
    ledger.path.write_bytes(whole + whole[:40])
    assert ledger.recorded(evaluation()) is not None
    ledger.begin(evaluation(worlds=7))
    assert ledger.path.read_bytes().startswith(whole)
    assert len(ledger.path.read_bytes().splitlines()) == 3


def test_a_file_that_failed_the_tests_is_not_counted(ledger):
    """No hidden world was driven; what failed is driven again."""
    about = evaluation()
    ledger.end(ledger.begin(about), about, report(0, tests={"test_imports": "failed"}))
    assert ledger.recorded(about) is None
    assert driven(ledger, evaluation(worlds=7)).hidden.count == 1


def test_a_ledger_that_cannot_be_used_is_one_line(tmp_path):
    (tmp_path / "file").touch()
    below = Ledger(tmp_path / "file" / "hidden.jsonl")
    with pytest.raises(TaskError, match=r"^the ledger of hidden evaluations, "):
        below.begin(evaluation())


def test_it_is_in_the_folder_of_the_user(monkeypatch, tmp_path):
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    assert user_ledger().path.parent == tmp_path / "tdac"
