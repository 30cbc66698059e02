"""Bounds on the answers of all providers."""

from __future__ import annotations

from tdac_agent.models.provider import ProviderFault, Reply

MAX_CHARS = 2_000_000
MAX_TOKENS = 10**9
"""Most tokens that an answer may be said to have taken."""
COMMAND_BYTES = 4 * MAX_CHARS
"""Most bytes of an answer in any encoding."""
STREAM_BYTES = 64_000_000
"""Most bytes of a streamed answer; there may be 300 of them for a token."""
EVENT_BYTES = 4_000_000
EVENT_LINES = 1000
"""Most lines of an event of a stream; usually it has two."""
ERROR_BYTES = 100_000
"""Bytes of an error's description that are read."""
MAX_NOTES = 1000


def check_length(text: object) -> str:
    """Returns the text of an answer.

    Raises:
        ProviderFault: It is not a string, or too long.
    """
    if not isinstance(text, str):
        raise ProviderFault("malformed answer: the text is not a string")
    if len(text) > MAX_CHARS:
        raise ProviderFault(f"the answer has more than {MAX_CHARS} characters")
    return text


def check_count(value: object) -> int:
    """Returns a reported number of tokens, or 0 if there is none.

    Raises:
        ProviderFault: No answer takes so many.
    """
    if isinstance(value, bool) or not isinstance(value, int) or value < 0:
        return 0
    if value > MAX_TOKENS:
        raise ProviderFault(
            f"malformed answer: it reports more than {MAX_TOKENS} tokens"
        )
    return value


def check_reply(reply: Reply) -> Reply:
    """Returns a provider's answer if a run can record it.

    Raises:
        ProviderFault: It cannot.
    """
    check_length(reply.text)
    read, written = reply.tokens_cached, reply.tokens_written
    counts = (reply.tokens_in, reply.tokens_out, read, written)
    if any(type(count) is not int or check_count(count) != count for count in counts):
        raise ProviderFault("malformed answer: a number of tokens is not a count")
    notes = reply.notes
    if not isinstance(notes, tuple | list) or len(notes) > MAX_NOTES:
        raise ProviderFault(
            f"malformed answer: not a list of {MAX_NOTES} notes or less"
        )
    words = (*notes, reply.model or "", reply.request_id or "")
    if not all(isinstance(word, str) for word in words):
        raise ProviderFault("malformed answer: a note or name is not a string")
    check_length("".join(words))
    return reply
