"""What a run may cost: prices, worst cases, and what bounds it without a price."""

import re
import sys
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from script import STILL
from small import write_small_task
from unconfirmed import synthesize

from tdac_agent import load_task
from tdac_agent.errors import ProviderError
from tdac_agent.models.budget import NOTHING, Budget
from tdac_agent.models.prices import SHIPPED, Price
from tdac_agent.models.provider import Reply, Request
from tdac_agent.models.tariff import UNPRICED_TOKENS, Tariff, bounds_of, tariffs_of
from tdac_agent.runs.run_record import load_run
from tdac_envs.core.extras import install_command

PRICE = Price(input=2, output=10, cache_read=0.1, cache_write=2.5)


class Model:
    """A model that costs money, by its name."""

    paid = True

    def __init__(self, name, served_at=None, *answers):
        self.name = name
        self.served_at = served_at
        self.answers = list(answers)

    def complete(self, request):
        return self.answers.pop(0)


@pytest.fixture(autouse=True)
def shipped_prices(monkeypatch):
    monkeypatch.setenv("TDAC_PRICES", str(SHIPPED))


COUNTS = st.integers(0, 10**6)


@given(COUNTS, COUNTS, COUNTS, COUNTS)
def test_a_cost_by_hand(plain, cached, written, out):
    """Each kind of token at its own price; one that is not listed is the input's."""
    reply = Reply(
        "",
        tokens_in=plain + cached + written,
        tokens_out=out,
        tokens_cached=cached,
        tokens_written=written,
    )
    cents = 2 * plain + 0.1 * cached + 2.5 * written + 10 * out
    assert PRICE.cost(reply) == pytest.approx(cents / 1e6)
    simple = Price(input=2, output=10)
    assert simple.cost(reply) == pytest.approx((2 * reply.tokens_in + 10 * out) / 1e6)
    assert PRICE.cost(reply) <= PRICE.most(reply.tokens_in, out) + 1e-12


@given(st.text(), st.integers(1, 10**5), st.data())
def test_no_answer_costs_more_than_the_worst(prompt, room, data):
    """However a tokenizer cuts the prompt, and whatever part of it is cached."""
    tariff, request = Tariff(price=PRICE), Request("edit", prompt, max_tokens=room)
    most = len(prompt.encode())
    tokens_in = data.draw(st.integers(0, most))
    cached = data.draw(st.integers(0, tokens_in))
    written = data.draw(st.integers(0, tokens_in - cached))
    out = data.draw(st.integers(1, room))
    reply = Reply("x", "end", tokens_in, out, cached, written)
    worst, spent = tariff.worst(request), tariff.spent(request, reply)
    assert spent.tokens <= worst.tokens
    assert spent.usd <= worst.usd + 1e-12
    # What is not reported may have been all of it.
    assert tariff.spent(request, Reply("x")) == worst
    assert Tariff(free=True).worst(request) == NOTHING


@pytest.mark.parametrize(
    ("name", "served_at", "given", "limit"),
    [
        ("openai:gpt-4o", None, None, None),
        ("command:llm", None, None, None),
        ("manual:mail", None, None, None),
        ("openai:qwen", "http://localhost:1/v1", None, UNPRICED_TOKENS),
        ("openai:qwen", "http://localhost:1/v1", 77, 77),
        ("openai:unheard-of", None, 77, 77),
        ("mine:words", None, None, UNPRICED_TOKENS),
    ],
)
def test_what_bounds_a_run(name, served_at, given, limit):
    """A price, or tokens; where there is no price, that is said in one line."""
    models = [Model(name, served_at)]
    bounds = bounds_of(models, tariffs_of(models), None, given)
    assert bounds.max_cost == 2.0
    assert bounds.max_tokens == limit
    assert len(bounds.notes) == (limit is not None)
    for note in bounds.notes:
        assert f"no price is known for {name}" in note
        assert str(limit) in note


def test_a_vendor_without_a_price(tmp_path):
    """Nothing would bound the bill: refused before a folder is made."""
    models = [Model("anthropic:unheard-of")]
    with pytest.raises(ProviderError, match="give --max-tokens N, or enter its price"):
        bounds_of(models, tariffs_of(models), 5.0, None)


def code(source, *counts):
    return Reply(f"```python\n{source}```\n", "end", *counts)


@pytest.mark.slow
def test_an_exhausted_budget_stops_a_run(
    tmp_path, good_source, tdac, monkeypatch, warm
):
    """Censored, with what it took; more money and it goes on, spending counted on."""
    task = load_task(write_small_task(tmp_path / "task", profile="policy"))
    out = tmp_path / "run"
    model = Model("openai:gpt-4o", None, code(STILL, 8000, 4000, 2000))
    limits = {"max_output": 5000, "max_cost": 0.12}
    run = synthesize(task, model, out=out, **limits, judge=warm)
    assert (run.status, run.censored, run.tau) == ("budget", True, None)
    price = 2.5 * 8000 + 10 * 4000
    assert run.cost == pytest.approx(price / 1e6)
    assert "0.0600 USD of 0.12 USD are spent or reserved" in run.reason
    # What is spent, and the worst case of the next call, twice.
    assert 2 * run.cost + 0.1 < run.enough.max_cost < 0.4
    assert model.answers == []
    # The same limit again asks nothing: exit 4, and what to do.
    monkeypatch.setenv("OPENAI_API_KEY", "sk-none")
    exit_code, told, _ = tdac("synth", "--resume", out)
    assert exit_code == 4
    assert "stopped by the budget: 0.0600 USD of 0.12 USD are spent" in told
    assert f"to continue: tdac synth --resume {out} {run.enough}" in told
    assert "at most 59 questions are left: --max-cost 0." in told
    assert "8000 tokens in (2000 from a cache), 4000 out; 0.0600 USD" in told
    limits["max_cost"] = 0.5
    model.answers = [code(good_source, 9000, 3000)]
    run = synthesize(task, model, out=out, **limits, judge=warm)
    assert (run.status, run.censored) == ("verified", False)
    assert (run.reason, run.enough, run.outlook) == ("", None, "")
    price += 2.5 * 9000 + 10 * 3000
    assert run.cost == pytest.approx(price / 1e6)
    assert load_run(out) == run


@pytest.mark.slow
def test_answers_that_report_no_tokens(tmp_path, tdac):
    """They count with what was reserved, which is said beside what was reported."""
    folder = write_small_task(tmp_path / "task", profile="policy")
    program = tmp_path / "model.py"
    program.write_text("import sys; sys.stdin.read(); print('I would rather not.')")
    model = f"command:{sys.executable} {program}"
    words = ("--task", folder, "--learner", model, "--out", tmp_path / "run")
    exit_code, told, _ = tdac("synth", *words, "--max-tokens", 60_000)
    assert exit_code == 4
    assert re.search(r"\d+ of 60000 tokens are spent or reserved", told)
    assert "no tokens reported: each answer counts as the full amount reserved" in told


def test_a_shared_budget_has_limits_of_its_own(tmp_path, small_task, warm):
    """Limits of a run beside it would mean nothing."""
    with pytest.raises(ValueError, match="give either a shared budget"):
        synthesize(
            small_task, out=tmp_path / "r", max_cost=1.0, budget=Budget(1.0), judge=warm
        )


def test_all_that_is_missing_is_said_at_once(tdac, refused, monkeypatch):
    """Keys, a package and a price, in one line; a dry run says it, too."""
    for name in ("OPENAI_API_KEY", "ANTHROPIC_API_KEY"):
        monkeypatch.delenv(name, raising=False)
        monkeypatch.delenv(name.replace("API_KEY", "BASE_URL"), raising=False)
    monkeypatch.setitem(sys.modules, "anthropic", None)
    words = ("synth", "--learner", "openai:unheard-of", "--optimizer", "anthropic:x")
    err = refused(*words, "--out", "r")
    needed = [
        "set the environment variable OPENAI_API_KEY",
        f"anthropic:x needs a package: {install_command(None)}",
        "set the environment variable ANTHROPIC_API_KEY",
    ]
    for line in [*needed, "no price is known for openai:unheard-of"]:
        assert line in err
    exit_code, _, err = tdac(*words, "--dry-run")
    assert exit_code == 0
    for line in needed:
        assert re.search(f"still needed: .*{re.escape(line)}", err)
    assert not Path("r").exists()


def test_words_that_bound_nothing(refused, monkeypatch):
    """One clear line, and no folder."""
    monkeypatch.setenv("OPENAI_API_KEY", "sk-none")
    words = ("synth", "--out", "r", "--learner")
    err = refused(*words, "openai:unheard-of")
    assert "no price is known for openai:unheard-of" in err
    err = refused(*words, "openai:gpt-4o", "--max-cost", "inf")
    assert "--max-cost must be finite" in err
    assert not Path("r").exists()
