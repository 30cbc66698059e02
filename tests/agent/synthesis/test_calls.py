"""One question: reserved, written down, asked, settled, and found again."""

import socket
from dataclasses import replace

import pytest
from script import Paid

from tdac_agent.errors import Fault
from tdac_agent.models.budget import NOTHING, Amount, Budget
from tdac_agent.models.openai_api import OpenAIModel
from tdac_agent.models.prices import Price
from tdac_agent.models.provider import (
    PermanentFault,
    ProviderFault,
    RateLimited,
    Reply,
    Request,
)
from tdac_agent.models.retry import RetryPolicy
from tdac_agent.models.tariff import Tariff
from tdac_agent.runs.journal_state import call_key, read_past
from tdac_agent.runs.recorder import Recorder
from tdac_agent.runs.run_record import Run
from tdac_agent.storage.journal import read_records
from tdac_agent.synthesis.calls import Calls, OutOfBudget
from tdac_agent.synthesis.options import SynthOptions

QUESTION = Request("generate", "What?", sample=(0, 1, 0), max_tokens=100)
TARIFF = Tariff(price=Price(input=1000, output=1000))
WORST = TARIFF.worst(QUESTION)
ANSWER = Reply("yes", tokens_in=3, tokens_out=7, model="m-1", notes=("so",))


@pytest.fixture
def make(tmp_path):
    """Calls of a process that finds what the ones before have left."""

    def calls(budget):
        run = Run(
            folder=tmp_path,
            task="t",
            task_sha256="",
            learner="script",
            optimizer="script",
            iterations=1,
            patience=0,
            seed=0,
            started="",
            cost=0.0,
        )
        past = read_past(read_records(tmp_path / "journal.jsonl"))
        budget.restore({f"{run.id}/{call}": a for call, a in past.taken.items()})
        retry = RetryPolicy(first_wait=0.0)
        recorder = Recorder(run, past)
        return Calls(
            recorder, budget, {"script": TARIFF}, retry, SynthOptions(max_output=100)
        )

    return calls


def test_an_answer_is_settled_and_found_again(make):
    """What it took replaces what was reserved; the next process does not ask."""
    budget = Budget(max_cost=1.0)
    assert make(budget).ask(Paid(ANSWER), QUESTION) == ANSWER
    assert budget.taken == Amount(10, 0.01)
    again, later = Budget(max_cost=1.0), Paid()
    calls = make(again)
    assert calls.ask(later, QUESTION) == ANSWER
    assert again.taken == Amount(10, 0.01)
    run = calls.recorder.run
    assert (run.cost, run.tokens_in, run.tokens_out, run.models) == (
        *(0.01, 3, 7, ("m-1",)),
    )
    # One more question is another one, though it reads the same.
    later.answers = [replace(ANSWER, text="no")]
    assert calls.ask(later, QUESTION).text == "no"


@pytest.mark.parametrize(
    ("fault", "lost"),
    [(ProviderFault("cut"), 1), (RateLimited("slow"), 0), (PermanentFault("401"), 0)],
)
def test_what_was_lost_counts(make, fault, lost):
    """An answer that may have been billed, with all that was reserved for it."""
    budget, model = Budget(max_cost=1.0), Paid(fault, ANSWER)
    if isinstance(fault, PermanentFault):
        with pytest.raises(Fault, match="401"):
            make(budget).ask(model, QUESTION)
        assert budget.taken == NOTHING
        return
    calls = make(budget)
    calls.ask(model, QUESTION)
    expected = 0.01 + lost * WORST.usd
    assert budget.taken.usd == pytest.approx(expected)
    assert calls.recorder.run.cost_lost == pytest.approx(lost * WORST.usd)
    again = Budget()
    assert make(again).recorder.past.lost_usd == pytest.approx(lost * WORST.usd)
    assert again.taken.usd == pytest.approx(expected)


def test_a_process_that_dies_in_a_call(make):
    """What it reserved counts, and the question is put once more."""
    with pytest.raises(KeyboardInterrupt):
        make(Budget()).ask(Paid(KeyboardInterrupt()), QUESTION)
    budget = Budget(max_cost=2 * WORST.usd)
    calls = make(budget)
    assert len(calls.recorder.past.open) == 1
    assert budget.taken == WORST
    assert calls.ask(Paid(ANSWER), QUESTION) == ANSWER
    assert budget.taken.usd == pytest.approx(WORST.usd + 0.01)
    # Answered since; what the lost answer may have cost stays.
    later = make(Budget()).recorder.past
    assert (calls.recorder.past.unanswered, later.unanswered) == (1, 0)
    assert later.lost_usd == pytest.approx(WORST.usd)
    small = Budget(max_cost=1.9 * WORST.usd)
    with pytest.raises(OutOfBudget):
        make(small).ask(Paid(ANSWER), replace(QUESTION, prompt="Other?"))


def test_a_key_covers_all_that_shapes_an_answer():
    """Model, server, kind, prompt, room, sample and turn; not the time it may take."""
    model, served = Paid(), Paid()
    served.served_at = "http://localhost:1/v1"
    other = Paid()
    other.name = "other"
    changes = [
        {"kind": "edit"},
        {"prompt": "Who?"},
        {"max_tokens": 99},
        {"sample": (1, 1, 0)},
        {"sample": (0, 2, 0)},
        {"sample": (0, 1, 1)},
        {"turn": 1},
    ]
    keys = [call_key(m, QUESTION) for m in (model, served, other)]
    keys += [call_key(model, replace(QUESTION, **change)) for change in changes]
    assert len(set(keys)) == len(keys)
    assert call_key(model, replace(QUESTION, seconds=1.0)) == keys[0]


def test_a_server_that_is_not_there_bills_nothing(monkeypatch):
    """No connection, no question."""
    monkeypatch.setenv("OPENAI_API_KEY", "sk-none")
    with socket.socket() as closed:
        closed.bind(("127.0.0.1", 0))
        url = f"http://127.0.0.1:{closed.getsockname()[1]}/v1"
        with pytest.raises(ProviderFault) as caught:
            OpenAIModel("m", url).complete(QUESTION)
    assert not caught.value.billed


def test_an_address_is_kept_without_its_secrets():
    """What the environment says may hold a user, a password, a query."""
    model = OpenAIModel("m", "https://me:secret@example.org:8080/v1?key=hidden#x")
    assert model.served_at == "https://example.org:8080/v1"
    assert OpenAIModel("m", None).served_at is None
