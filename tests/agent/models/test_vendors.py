"""The table of vendors: an entry is enough for all that a vendor needs."""

from pathlib import Path

import pytest
from fault_server import OPENAI, answers
from nicegui import Client
from nicegui.page import page

from tdac_agent.cli import doctor
from tdac_agent.errors import ProviderError
from tdac_agent.models import vendors
from tdac_agent.models.choice import Options, check_names, choose_model
from tdac_agent.models.provider import Request, missing_for, served_at
from tdac_agent.models.ready import check_ready, needs_limit
from tdac_agent.models.vendors import VENDORS, Vendor
from tdac_agent.studio.pages.writers import Writers

PRICES = """
schema: 1
dated: 2026-11-01
models: {made-up:small: {input: 1, output: 2}}
"""


@pytest.fixture
def made_up(server, monkeypatch):
    """A vendor with the API of another one, at a URL of its own."""
    url = server.url(OPENAI)
    vendor = Vendor("made-up", "Made Up", vendors.OPENAI, example="small", url=url)
    monkeypatch.setitem(VENDORS, vendor.name, vendor)
    monkeypatch.setenv("MADE_UP_API_KEY", "sk-made-up-0123456789")
    monkeypatch.delenv("MADE_UP_BASE_URL", raising=False)
    return vendor


def test_an_entry_is_asked_at_its_url(made_up, server):
    """With its own key, under its own name, and as the vendor itself."""
    server.script = [answers(OPENAI, "Hello")]
    model = choose_model("made-up:small", Options(None))
    assert (model.name, served_at(model), model.missing) == ("made-up:small", None, ())
    assert model.complete(Request("generate", "Hello?", max_tokens=9)).text == "Hello"
    (seen,) = server.seen
    assert seen.headers["authorization"] == "Bearer sk-made-up-0123456789"
    # Only OpenAI itself is known to have the newer name of the limit.
    assert (seen.body["model"], seen.body["max_tokens"]) == ("small", 9)


def test_an_entry_may_be_served_elsewhere(made_up, server, monkeypatch):
    """`--base-url` or its variable name another server, which needs no key."""
    monkeypatch.delenv("MADE_UP_API_KEY")
    model = choose_model("made-up:small", Options(None, server.url(OPENAI)))
    assert (served_at(model), model.missing) == (server.url(OPENAI), ())
    monkeypatch.setenv("MADE_UP_BASE_URL", "http://127.0.0.1:9/v1")
    other = choose_model("made-up:small", Options(None))
    assert served_at(other) == "http://127.0.0.1:9/v1"
    with pytest.raises(ProviderError, match="MADE_UP_BASE_URL or OPENAI_BASE_URL for"):
        check_names(["made-up:small", "openai:x"], "http://127.0.0.1:9/v1")
    with pytest.raises(ProviderError, match=r"is for .* and made-up:MODEL; no such"):
        check_names(["builtin"], "http://127.0.0.1:9/v1")


def test_an_entry_needs_a_key_and_a_price(made_up, tmp_path, monkeypatch):
    """A listed model has its price as a bound; another one is refused without one."""
    prices = tmp_path / "prices.yaml"
    prices.write_text(PRICES)
    monkeypatch.setenv("TDAC_PRICES", str(prices))
    check_ready(["made-up:small"], {})
    assert needs_limit("made-up:small", None)
    with pytest.raises(ProviderError, match="no price is known for made-up:large, so"):
        check_ready(["made-up:large"], {})
    check_ready(["made-up:large"], {"max_tokens": 1000})
    monkeypatch.delenv("MADE_UP_API_KEY")
    missing = "no key for Made Up: set the environment variable MADE_UP_API_KEY"
    assert missing_for(choose_model("made-up:small", Options(None))) == (missing,)
    with pytest.raises(ProviderError, match="needs a model, as in made-up:small"):
        choose_model("made-up", Options(None))


def test_an_entry_is_named(made_up, monkeypatch):
    """In the list of models, by the doctor, and by the studio."""
    with pytest.raises(ProviderError, match=r"known: builtin, .*, made-up:MODEL, comm"):
        check_names(["other"], None)
    keys = {check.name: check.works for check in doctor._keys()}
    assert keys["key MADE_UP_API_KEY"]
    monkeypatch.delenv("MADE_UP_API_KEY")
    with Client(page("/")):
        writers = Writers(Path(), lambda: None)
        assert writers._who.options["made-up"] == "a model of Made Up"
        writers._who.value, writers._model.value = "made-up", "small"
        assert "MADE_UP_API_KEY" in writers.problem()
        assert writers.words()[:2] == ["--learner", "made-up:small"]


@pytest.mark.parametrize("vendor", VENDORS.values(), ids=list(VENDORS))
def test_the_page_on_models_names_each_vendor(vendor):
    """With its form and the variable of its key."""
    page = Path(__file__).parents[3] / "docs/models.md"
    start = f"| `{vendor.name}:MODEL` "
    lines = page.read_text("utf-8").splitlines()
    (row,) = (line for line in lines if line.startswith(start))
    assert f"`{vendor.key}`" in row
