"""Every way in which a vendor's server can fail, through the real packages."""

import pytest
from fault_server import (
    MODEL,
    OPENAI,
    PATHS,
    VENDORS,
    answers,
    begins,
    error_event,
    events,
    fails,
    raw,
)
from rich.console import Console
from rich.table import Table

from tdac_agent.models.anthropic_api import AnthropicModel
from tdac_agent.models.openai_api import OpenAIModel
from tdac_agent.models.provider import ProviderFault, RateLimited, Reply, Request

QUESTION = Request("generate", "Write a controller.", stable=6, max_tokens=1234)


def model_of(vendor, server, stall=30.0):
    make = OpenAIModel if vendor == OPENAI else AnthropicModel
    return make("some-model", server.url(vendor), stall)


def stop_word(vendor, meaning):
    """What a vendor calls a reason to stop."""
    own = {"length": "length", "refusal": "content_filter"}
    other = {"length": "max_tokens", "refusal": "refusal"}
    return (own if vendor == OPENAI else other)[meaning]


def reason_at(vendor):
    """Which event of a stream says why it stops."""
    words = ('"end_turn"', '"finish_reason": "stop"')
    whole = events(vendor)
    return next(at for at, event in enumerate(whole) if any(w in event for w in words))


def hurry(seconds):
    return lambda vendor: fails(vendor, 429, "rate_limit_error", retry_after=seconds)


def cut(pieces):
    return lambda vendor: begins(vendor, lambda line: None, pieces=pieces)


def reset(pieces):
    return lambda vendor: begins(vendor, lambda line: line.reset(), pieces=pieces)


def status(code, kind="api_error"):
    return lambda vendor: fails(vendor, code, kind)


def mid_stream(kind):
    return lambda vendor: begins(
        vendor, lambda line: line.send(error_event(vendor, kind))
    )


FAULTS = {
    "429": (status(429, "rate_limit_error"), "rate limit"),
    "429, retry-after 7": (hurry("7"), "rate limit 7"),
    "429, retry-after 0.5": (hurry("0.5"), "rate limit 0.5"),
    "429, retry-after 1e9": (hurry("1e9"), "rate limit 1000000000"),
    "429, retry-after -5": (hurry("-5"), "rate limit"),
    "429, retry-after nan": (hurry("nan"), "rate limit"),
    "429, retry-after in the past": (
        hurry("Wed, 21 Oct 2015 07:28:00 GMT"),
        "rate limit 0",
    ),
    "429, retry-after soon": (hurry("soon"), "rate limit"),
    "429, no credit": (status(429, "insufficient_quota"), "permanent"),
    "500": (status(500), "transient"),
    "502": (status(502), "transient"),
    "503": (status(503), "transient"),
    "504": (status(504), "transient"),
    "529": (status(529, "overloaded_error"), "transient"),
    "408": (status(408), "transient"),
    "409": (status(409), "transient"),
    "400": (status(400, "invalid_request_error"), "permanent"),
    "401": (status(401, "authentication_error"), "permanent"),
    "402": (status(402, "billing_error"), "permanent"),
    "403": (status(403, "permission_error"), "permanent"),
    "404": (status(404, "not_found_error"), "permanent"),
    "413": (status(413, "request_too_large"), "permanent"),
    "422": (status(422), "permanent"),
    "503, a page": (
        lambda vendor: raw("<html>busy</html>", "text/html", 503),
        "transient",
    ),
    "307 to elsewhere": (
        lambda vendor: lambda line: line.start(307, location="/elsewhere"),
        "permanent",
    ),
    "reset at once": (lambda vendor: lambda line: line.reset(), "transient"),
    "reset in mid-stream": (reset(4), "transient"),
    "stall before the answer": (
        lambda vendor: lambda line: line.stall(),
        "transient",
    ),
    "stall in mid-stream": (
        lambda vendor: begins(vendor, lambda line: line.stall()),
        "transient",
    ),
    "clean cut, nothing sent": (cut(0), "transient"),
    "clean cut after the first event": (cut(1), "transient"),
    "clean cut in mid-stream": (cut(4), "transient"),
    "clean cut before the stop reason": (
        lambda vendor: cut(reason_at(vendor))(vendor),
        "transient",
    ),
    "error event, overloaded": (mid_stream("overloaded_error"), "transient"),
    "error event, rate limit": (mid_stream("rate_limit_error"), "rate limit"),
    "error event, too long": (mid_stream("request_too_large"), "permanent"),
    "malformed JSON in an event": (
        lambda vendor: begins(
            vendor, lambda line: line.send("event: message_delta\ndata: {oops\n\n")
        ),
        "transient",
    ),
    "an event that is a list": (
        lambda vendor: begins(
            vendor, lambda line: line.send("event: message_delta\ndata: [1]\n\n")
        ),
        "transient",
    ),
    "an event that is null": (
        lambda vendor: begins(
            vendor, lambda line: line.send("event: message_delta\ndata: null\n\n")
        ),
        "transient",
    ),
    "200 with JSON, no stream": (
        lambda vendor: raw('"all is well"', "application/json"),
        "transient",
    ),
    "200 with a page": (
        lambda vendor: raw("<html>login</html>", "text/html"),
        "transient",
    ),
    "empty body": (lambda vendor: raw(""), "transient"),
    "not UTF-8": (
        lambda vendor: begins(
            vendor, lambda line: line.handler.wfile.write(b"data: \xff\xfe\n\n")
        ),
        "transient",
    ),
    "an unknown stop reason": (
        lambda vendor: answers(vendor, stop="tool_use"),
        "transient",
    ),
    "max_tokens": (
        lambda vendor: answers(vendor, stop=stop_word(vendor, "length")),
        "truncated",
    ),
    "refusal": (
        lambda vendor: answers(vendor, "", stop=stop_word(vendor, "refusal")),
        "refused",
    ),
    "empty content": (lambda vendor: answers(vendor, ""), "answer of 0 characters"),
    "a whole answer": (answers, "answer of 5 characters"),
}


def outcome(model, request=QUESTION):
    """What came of a question, in words."""
    try:
        reply = model.complete(request)
    except RateLimited as fault:
        after = "" if fault.retry_after is None else f" {fault.retry_after:.10g}"
        return f"{fault.kind}{after}", str(fault)
    except ProviderFault as fault:
        return fault.kind, str(fault)
    names = {"length": "truncated", "refusal": "refused"}
    told = names.get(reply.stop, f"answer of {len(reply.text)} characters")
    return told, repr(reply.text)


@pytest.mark.slow
def test_each_fault_is_what_it_is(server, canary):
    """Transient, rate limit, permanent, truncated, refused or an answer: one try each.

    Prints the table (`pytest -s`).
    """
    table = Table("fault", *VENDORS, "as told", title="what each fault is taken for")
    wrong = []
    for fault, (play, expected) in FAULTS.items():
        results = [_try(server, canary, vendor, fault, play) for vendor in VENDORS]
        (first, message), (second, _) = results
        table.add_row(fault, first, second, message)
        if {first, second} != {expected}:
            wrong.append((fault, expected, results))
    Console(width=150).print(table)
    assert wrong == []


BILLED = {"429": False, "401": False, "503": False, "307 to elsewhere": False}
BILLED |= dict.fromkeys(
    (
        *("reset at once", "reset in mid-stream", "clean cut in mid-stream"),
        *("error event, overloaded", "an unknown stop reason"),
    ),
    True,
)


@pytest.mark.slow
@pytest.mark.parametrize("vendor", VENDORS)
def test_what_may_have_been_billed(server, canary, vendor):
    """A server that says no has not begun an answer; any other may have."""
    found = {}
    for name in BILLED:
        server.script = [FAULTS[name][0](vendor)]
        with pytest.raises(ProviderFault) as caught:
            model_of(vendor, server, 30.0).complete(QUESTION)
        found[name] = caught.value.billed
    assert found == BILLED


def _try(server, canary, vendor, fault, play):
    """What one fault of one vendor comes to; it was tried once, and told in a line."""
    server.script, server.seen = [play(vendor)], []
    # Silence is the one thing that only patience ends.
    stall = 0.2 if fault.startswith("stall") else 30.0
    told, message = outcome(model_of(vendor, server, stall))
    assert "\n" not in message
    assert len(message) < 400
    assert canary not in message
    assert [seen.path for seen in server.seen] == [PATHS[vendor]]
    return told, message


@pytest.mark.parametrize("vendor", VENDORS)
def test_a_whole_answer(server, canary, vendor):
    """Text, usage, model and request id; one request with one user message."""
    server.script = [answers(vendor, "Schön, 42.")]
    reply = model_of(vendor, server).complete(QUESTION)
    written = 0 if vendor == OPENAI else 3
    assert reply == Reply(
        "Schön, 42.",
        tokens_in=30,
        tokens_out=5,
        tokens_cached=20,
        tokens_written=written,
        model=MODEL,
        request_id="req_7",
    )
    (seen,) = server.seen
    assert seen.headers["authorization"] == f"Bearer {canary}"
    assert seen.body["model"] == "some-model"
    assert seen.body["max_tokens"] == 1234
    assert seen.body["stream"] is True
    assert "temperature" not in seen.body
    (message,) = seen.body["messages"]
    if vendor == OPENAI:
        assert message == {"role": "user", "content": QUESTION.prompt}
        return
    first, second = message["content"]
    assert first["text"] + second["text"] == QUESTION.prompt
    assert first["cache_control"] == {"type": "ephemeral"}
    assert "cache_control" not in second


@pytest.mark.parametrize("vendor", VENDORS)
@pytest.mark.parametrize("pieces", range(9))
def test_a_cut_stream_is_never_an_answer(server, vendor, pieces):
    """Wherever it ends: a fault up to the stop reason, the whole text from there on."""
    whole = events(vendor, "Hello", usage=False)
    reasons = [at for at, event in enumerate(whole) if '"end_turn"' in event]
    reasons += [
        at for at, event in enumerate(whole) if '"finish_reason": "stop"' in event
    ]
    server.script = [cut(pieces)(vendor)]
    told, _ = outcome(model_of(vendor, server))
    expected = "transient" if pieces <= reason_at(vendor) else "answer of 5 characters"
    assert told == expected


@pytest.mark.parametrize("vendor", VENDORS)
def test_an_answer_has_a_deadline(server, vendor):
    """A server that keeps the line busy holds nobody beyond the request's time."""

    def drips(line):
        line.start()
        while not line.closing.wait(0.02):
            line.send(": still here\n\n")

    server.script = [drips]
    slow = Request("generate", "?", seconds=0.3)
    told, message = outcome(model_of(vendor, server), slow)
    assert told == "transient"
    assert message == "no complete answer within 0.3 s"


def test_no_server(canary):
    """Nobody listens: transient, and the message says what was tried."""
    model = OpenAIModel("some-model", "http://127.0.0.1:9/v1")
    told, message = outcome(model)
    assert told == "transient"
    assert "refused" in message
