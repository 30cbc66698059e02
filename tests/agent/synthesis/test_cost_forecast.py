"""Before a run: the prompt as it will be asked, and the cost at most."""

import json
import sys
from datetime import date
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from small import write_small_task

from tdac_agent import load_task
from tdac_agent.models.prices import SHIPPED, Price, PriceError, PriceList, load_prices
from tdac_agent.models.provider import MAX_OUTPUT_TOKENS, Request
from tdac_agent.models.tariff import Tariff
from tdac_agent.models.tokens import estimate_tokens
from tdac_agent.prompting.prompt import generate_prompt
from tdac_agent.synthesis.cost_forecast import cost_of

PRICES = PriceList(
    dated=date(2026, 1, 2),
    models={
        "openai:dear": Price(input=10, output=50, cache_write=12),
        "openai:cheap": Price(input=1, output=2),
    },
    schema=1,
)


@pytest.fixture(autouse=True)
def own_settings(tmp_path, monkeypatch):
    """No price file of whoever runs the tests is read."""
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path / "config"))
    monkeypatch.delenv("TDAC_PRICES", raising=False)
    for name in ("ANTHROPIC_API_KEY", "OPENAI_API_KEY"):
        monkeypatch.delenv(name, raising=False)


def test_the_worst_case(small_task):
    """Every question of every iteration at list price, and three times as often."""
    question = generate_prompt(small_task, ())
    models = ("openai:dear", "openai:cheap")
    told = cost_of("small", question, *models, PRICES, iterations=3, patience=2)
    assert told.prompt == question
    assert told.questions == 3 * (1 + 2 + 1)
    tokens = estimate_tokens(told.prompt)
    assert told.prompt_tokens == tokens
    first = Request("generate", told.prompt)
    reserved = Tariff(price=PRICES.models["openai:dear"]).worst(first)
    assert told.first_cost == reserved.usd
    output = 3 * (50 + 3 * 2) * MAX_OUTPUT_TOKENS / 1e6
    inputs = told.cost_once - output
    assert inputs >= 3 * (12 + 3 * 1) * tokens / 1e6
    assert told.cost_most == pytest.approx(3 * inputs + 5 * output)


def test_unknown_prices_are_said(small_task):
    """No price is never a price of nothing; another server has its own."""
    question = generate_prompt(small_task, ())
    told = cost_of("small", question, "openai:none", "openai:cheap", PRICES)
    assert told.unknown_prices == ("openai:none",)
    assert (told.first_cost, told.cost_once, told.cost_most) == (None, None, None)
    there = "http://localhost:1/v1"
    models = ("openai:dear", "openai:dear")
    told = cost_of("small", question, *models, PRICES, base_url=there)
    assert told.unknown_prices == ("openai:dear",)
    told = cost_of("small", question, "builtin", "builtin", PRICES)
    assert (told.unknown_prices, told.cost_most) == ((), 0.0)


def test_a_dry_run_prints_the_prompt_and_nothing_else(tmp_path, tdac):
    """No key, no folder; stdout is the prompt to the letter, stderr the estimate."""
    folder = write_small_task(tmp_path / "task")
    learner = ("--learner", "anthropic:claude-sonnet-5-5")
    code, out, told = tdac("synth", "--task", folder, "--dry-run", *learner)
    assert code == 0
    assert out == generate_prompt(load_task(folder), ())
    assert f"about {estimate_tokens(out)} tokens (an estimate" in told
    assert "60 questions (K=20, J=1)" in told
    assert f"prices of {load_prices().dated}: {SHIPPED}" in told
    code, out_2, told = tdac("synth", "--task", folder, "--dry-run", "--json", *learner)
    assert json.loads(out_2)["prompt"] == out
    code, _, told = tdac(
        "synth", "--task", folder, "--dry-run", "--learner", "openai:unheard-of"
    )
    assert code == 0
    assert "price of openai:unheard-of: unknown" in told


@pytest.mark.slow
@pytest.mark.parametrize(
    ("words", "expected"),
    [
        ("anthropic:claude-sonnet-5-5", "2.00 USD (--max-cost, by default): enough"),
        (
            "anthropic:claude-sonnet-5-5 --max-cost 0.01",
            "0.0100 USD (--max-cost): not enough for the first question: give "
            "--max-cost 0.",
        ),
        ("openai:mine --max-tokens 9", "9 tokens (--max-tokens): not enough for the"),
        (
            "openai:mine --base-url http://localhost:1/v1",
            "1000000 tokens (--max-tokens): enough",
        ),
    ],
)
def test_a_dry_run_says_what_bounds_the_run(tmp_path, tdac, words, expected):
    """Also what nobody said, and whether the first question can be paid with it."""
    folder = write_small_task(tmp_path / "task")
    dry = ("synth", "--task", folder, "--dry-run", "--learner", *words.split())
    assert f"budget: {expected}" in tdac(*dry)[2]
    facts = json.loads(tdac(*dry, "--json")[1])
    needs = facts["first_needs"]
    assert bool(needs) == ("not enough" in expected)
    if needs:
        assert json.loads(tdac(*dry, *needs.split(), "--json")[1])["first_needs"] == ""


def test_a_dry_run_asks_for_a_limit_where_nothing_bounds_the_run(tmp_path, tdac):
    """As the run would, which is refused without."""
    folder = write_small_task(tmp_path / "task")
    dry = ("synth", "--task", folder, "--dry-run", "--learner", "openai:mine")
    needed = "still needed: --max-tokens N, since no price of openai:mine is known"
    assert needed in tdac(*dry)[2]
    assert needed not in tdac(*dry, "--max-tokens", 10**6)[2]


def test_a_dry_run_with_models_of_ones_own(tmp_path, tdac):
    """What a program or a person costs is not told, and no folder is made."""
    folder = write_small_task(tmp_path / "task")
    words = ("synth", "--task", folder, "--dry-run", "--learner")
    for name in ("manual:x", f"command:{sys.executable} -V"):
        code, _, told = tdac(*words, name)
        assert code == 0
        assert f"cost of {name}: not counted" in told
        assert "price" not in told
        assert list(Path().iterdir()) == []


@pytest.mark.parametrize("by", ["flag", "variable"])
def test_a_dry_run_with_a_server_of_ones_own(tmp_path, tdac, monkeypatch, by):
    """No price file can say what it costs, so none is suggested."""
    folder = write_small_task(tmp_path / "task")
    words = ("synth", "--task", folder, "--dry-run", "--learner", "openai:mine")
    url = "http://localhost:1/v1"
    if by == "variable":
        monkeypatch.setenv("OPENAI_BASE_URL", url)
    code, _, told = tdac(*words, *(["--base-url", url] if by == "flag" else []))
    assert code == 0
    assert "listed prices do not apply to a server of your own" in told
    assert "prices.yaml" not in told
    monkeypatch.delenv("OPENAI_BASE_URL", raising=False)
    told = tdac(*words, "--max-tokens", 10**6)[2]
    assert "to see the cost, add it to a copy of" in told


@pytest.mark.parametrize(
    ("name", "reason"),
    [
        ("antropic:x", "did you mean 'anthropic'"),
        ("command:none-such", "there is no program 'none-such'"),
        ("replay:none", "cannot replay: none is not a run folder"),
        ("manual:", "needs a folder, as in"),
        ("openai:", "needs a model, as in"),
    ],
)
def test_a_dry_run_of_what_cannot_be(tmp_path, refused, name, reason):
    """It is refused as the run would be."""
    folder = write_small_task(tmp_path / "task")
    told = refused("synth", "--task", folder, "--dry-run", "--learner", name)
    assert reason in told


def test_a_price_file_of_ones_own(tmp_path, monkeypatch, tdac):
    """The one in the settings folder is used, and $TDAC_PRICES before it."""
    text = "schema: 1\ndated: {}\nmodels:\n  openai:mine: {{input: 1, output: 1}}\n"
    own = tmp_path / "config" / "tdac" / "prices.yaml"
    own.parent.mkdir(parents=True)
    own.write_text(text.format("2026-12-24"))
    assert load_prices().dated == date(2026, 12, 24)
    named = tmp_path / "mine.yaml"
    named.write_text(text.format("2027-01-01"))
    monkeypatch.setenv("TDAC_PRICES", str(named))
    assert load_prices().dated == date(2027, 1, 1)
    folder = write_small_task(tmp_path / "task")
    code, _, told = tdac(
        "synth", "--task", folder, "--dry-run", "--learner", "openai:mine"
    )
    assert code == 0
    assert f"prices of 2027-01-01: {named}" in told


def test_the_shipped_prices_can_be_read():
    """They are dated, say where they are from, and no answer is free."""
    prices = load_prices(SHIPPED)
    assert prices.source
    assert prices.price_of("anthropic:claude-sonnet-5-5") is not None
    for name, price in prices.models.items():
        assert name.startswith(("anthropic:", "openai:"))
        assert 0 < price.input < price.output


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        ("[", "cannot read the prices in"),
        ("schema: 2\ndated: 2026-01-01\nmodels: {}\n", "schema"),
        ("schema: 1\nmodels: {}\n", "dated: is missing"),
        (
            "dated: 2026-01-01\nmodels: {openai:x: {input: -1, output: 1}}\n",
            "expected at least 0, got -1",
        ),
        (
            "dated: 2026-01-01\nmodels: {openai:x: {input: .nan, output: 1}}\n",
            "finite number",
        ),
        ("dated: 2026-01-01\nmodels: {}\ncurrency: EUR\n", "currency"),
    ],
)
def test_a_broken_price_file_is_refused(tmp_path, text, problem):
    """With the file and the key in question."""
    file = tmp_path / "prices.yaml"
    file.write_text(text)
    with pytest.raises(PriceError, match=problem) as caught:
        load_prices(file)
    assert str(file) in str(caught.value)
    with pytest.raises(PriceError, match="No such file"):
        load_prices(tmp_path / "none.yaml")


@given(st.text(), st.text())
def test_an_estimate_grows_with_the_text(one, other):
    """More text never has fewer tokens, and its parts have hardly more than it."""
    whole = estimate_tokens(one + other)
    parts = estimate_tokens(one) + estimate_tokens(other)
    assert max(estimate_tokens(one), estimate_tokens(other)) <= whole <= parts
    assert parts <= whole + 1
