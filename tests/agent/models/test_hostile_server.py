"""A server may be hostile or careless: bounds, memory, and where the key goes."""

import json
import os
import re
import subprocess
import sys

import pytest
from fault_server import ANTHROPIC, VENDORS, FaultServer, answers
from hostile_server import ATTACKS, HUGE
from small import write_small_task
from test_faults import QUESTION, model_of
from unconfirmed import synthesize

from tdac_agent import load_task
from tdac_agent.errors import Fault
from tdac_agent.models.bounds import MAX_CHARS, MAX_TOKENS, check_reply
from tdac_agent.models.provider import ProviderFault, Reply
from tdac_agent.models.retry import RetryPolicy
from tdac_agent.models.transport import _Answer
from tdac_agent.runs.resume import existing_run
from tdac_agent.runs.run_record import load_run
from tdac_agent.storage.journal import read_records

QUICK = ("2^63 tokens", "deep JSON", "a deep error", "a deep code", "a huge code")
MOST_GROWTH_MB = 100
# Asks in a process of its own, and prints the fault and by how much memory grew.
ASK = """
import importlib, resource, sys
from tdac_agent.models.provider import ProviderFault, Request
vendor, url = sys.argv[1:]
module = importlib.import_module(f"tdac_agent.models.{vendor}_api")
make = module.OpenAIModel if vendor == "openai" else module.AnthropicModel
model = make("m", url)
importlib.import_module(vendor)
def peak():
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss // 1024
def ask():
    try:
        model.complete(Request("generate", "Write.", max_tokens=10))
    except ProviderFault as fault:
        return f"{fault.kind}: {fault}"
ask()
before = peak()
print(ask())
print(peak() - before)
"""


@pytest.mark.parametrize("vendor", VENDORS)
@pytest.mark.parametrize(
    "name",
    [pytest.param(n, marks=[] if n in QUICK else pytest.mark.slow) for n in ATTACKS],
)
def test_an_attack_is_a_fault_in_one_line(server, vendor, name):
    """Of the right kind; its message is short, and says what the server did."""
    attack = ATTACKS[name]
    server.script = [attack.play(vendor)]
    with pytest.raises(ProviderFault) as caught:
        model_of(vendor, server).complete(QUESTION)
    told = str(caught.value)
    assert caught.value.kind == attack.fault
    assert re.search(attack.told, told)
    assert "\n" not in told
    assert len(told) <= 400


MEASURED = [name for name in ATTACKS if name.startswith(("an endless", "a gzip"))]


@pytest.mark.slow
@pytest.mark.parametrize("vendor", VENDORS)
@pytest.mark.parametrize("name", MEASURED)
def test_an_attack_takes_little_memory(server, vendor, name):
    """Four hundred megabytes are sent, and at most a hundred are ever held."""
    attack = ATTACKS[name]
    server.script = [answers(vendor), attack.play(vendor)]
    words = [sys.executable, "-c", ASK, vendor, server.url(vendor)]
    done = subprocess.run(words, capture_output=True, text=True, check=True)
    told, growth = done.stdout.splitlines()
    assert re.search(attack.told.removeprefix("^"), told)
    assert int(growth) <= MOST_GROWTH_MB


@pytest.mark.slow
@pytest.mark.parametrize("vendor", VENDORS)
@pytest.mark.parametrize("name", ["2^63 tokens", "deep JSON", "a gzip bomb"])
def test_a_run_survives_an_attack(server, vendor, name, tmp_path, good_source, warm):
    """It ends as a fault that can be read, and goes on with an honest server."""
    server.script = [ATTACKS[name].play(vendor)]
    task = load_task(write_small_task(tmp_path / "task", profile="policy"))
    out = tmp_path / "run"
    options = {"out": out, "base_url": server.url(vendor), "judge": warm}
    retry = RetryPolicy(retries=1, first_wait=0.0)
    with pytest.raises(Fault, match=ATTACKS[name].told) as caught:
        synthesize(task, f"{vendor}:m", retry=retry, **options)
    assert "\n" not in str(caught.value)
    assert load_run(out).status == "fault"
    faults = [r for r in read_records(out / "journal.jsonl") if "fault" in r]
    assert [record["event"] for record in faults] == ["call.fault"] * 2
    server.script = [answers(vendor, f"```python\n{good_source}```\n")]
    run = synthesize(task, f"{vendor}:m", **options)
    assert run.passed
    assert existing_run(out).tokens_out == 5


@pytest.fixture
def proxy(monkeypatch, canary):
    """A proxy that answers everything by itself."""
    with FaultServer() as proxy:
        for name in ("HTTP_PROXY", "http_proxy", "ALL_PROXY", "all_proxy"):
            monkeypatch.setenv(name, proxy.url(ANTHROPIC))
        for name in ("NO_PROXY", "no_proxy"):
            monkeypatch.delenv(name, raising=False)
        yield proxy


@pytest.mark.parametrize("vendor", VENDORS)
def test_a_server_of_this_machine_is_asked_without_a_proxy(vendor, server, proxy):
    """The key would go to the proxy in clear, and the proxy's answer would count."""
    server.script = [answers(vendor, "mine")]
    proxy.script = [answers(vendor, "the proxy's")]
    assert model_of(vendor, server).complete(QUESTION).text == "mine"
    assert proxy.seen == []


@pytest.mark.parametrize("vendor", VENDORS)
def test_other_servers_are_asked_through_a_proxy(vendor, proxy):
    """Where the network has a proxy, it is the only way out."""
    proxy.script = [answers(vendor, "the proxy's")]
    model = type(model_of(vendor, proxy))("m", "http://models.invalid/v1")
    os.environ.pop(f"{vendor.upper()}_API_KEY")
    assert model.complete(QUESTION).text == "the proxy's"
    assert "canary" not in json.dumps([seen.headers for seen in proxy.seen])


@pytest.mark.parametrize("vendor", VENDORS)
def test_a_proxy_that_cannot_be_used(vendor, server, proxy, monkeypatch):
    """It is named in one line; a server of this machine is asked as usual."""
    monkeypatch.setenv("ALL_PROXY", "gopher://127.0.0.1:9")
    monkeypatch.setenv("all_proxy", "gopher://127.0.0.1:9")
    server.script = [answers(vendor, "mine")]
    assert model_of(vendor, server).complete(QUESTION).text == "mine"
    model = type(model_of(vendor, server))("m", "https://models.invalid/v1")
    with pytest.raises(ProviderFault, match=r"^the proxy: .*gopher") as caught:
        model.complete(QUESTION)
    assert caught.value.kind == "permanent"


class Pieces(list):
    """A stream that is these pieces."""


@pytest.mark.parametrize("size", [1, 2, 3, 7, 4096])
@pytest.mark.parametrize("end", ["\n", "\r\n"])
def test_a_long_stream_of_small_events_is_read(size, end):
    """However it is cut into pieces: a blank line ends an event."""
    event = f"event: a{end}data: {'x' * 40}{end}{end}".encode()
    whole = event * 2000
    pieces = [whole[at : at + size] for at in range(0, len(whole), size)]
    assert b"".join(_Answer(Pieces(pieces), "")) == whole


WRONG = {
    "tokens": Reply("a", tokens_in=HUGE),
    "negative": Reply("a", tokens_out=-1),
    "a fraction": Reply("a", tokens_out=0.5),
    "text": Reply("a" * (MAX_CHARS + 1)),
    "no text": Reply(None),
    "notes": Reply("a", notes=("b" * MAX_CHARS, "b")),
    "many notes": Reply("a", notes=("",) * 1000 + ("b" * (MAX_CHARS + 1),)),
    "a note that is none": Reply("a", notes=("b", 7)),
    "notes that are none": Reply("a", notes=7),
    "model": Reply("a", model=["m"]),
    "request": Reply("a", request_id=7),
}


@pytest.mark.parametrize("name", WRONG)
def test_answers_of_any_provider_have_bounds(name):
    """Also those of providers in other packages: what is recorded can be read."""
    with pytest.raises(ProviderFault):
        check_reply(WRONG[name])
    check_reply(Reply("a" * MAX_CHARS, tokens_in=MAX_TOKENS, notes=("b",)))
