"""Classify errors of vendors' packages as transient, rate limit or permanent."""

from __future__ import annotations

import math
from collections.abc import Generator, Mapping
from contextlib import contextmanager
from datetime import UTC, datetime
from email.utils import parsedate_to_datetime

from tdac_agent.models.provider import PermanentFault, ProviderFault, RateLimited
from tdac_agent.storage.secrets import one_line

Headers = Mapping[str, str]

# Transient besides 5xx: request time-out, conflict, too early.
TRANSIENT_STATUS = frozenset({408, 409, 425})
# Types and codes in the body of an error, of both vendors. Only they identify an error
# in mid-stream, since its status is 200.
LIMITED_WORDS = frozenset({"rate_limit_error", "rate_limit_exceeded"})
PERMANENT_WORDS = frozenset(
    {
        *("invalid_request_error", "authentication_error", "permission_error"),
        *("not_found_error", "request_too_large", "billing_error"),
        *("insufficient_quota", "billing_hard_limit_reached", "invalid_api_key"),
        *("model_not_found", "context_length_exceeded"),
    }
)


def fault_of(error: Exception) -> ProviderFault:
    """Returns the fault for an error of a vendor's package.

    Args:
        error: Error of `anthropic`, `openai`, or the HTTP library below them.
    """
    response = getattr(error, "response", None)
    headers: Headers = getattr(response, "headers", {})
    status = getattr(error, "status_code", None) or 200
    words, text = _parse_body(getattr(error, "body", None))
    message = _message(error, status, words, text, headers)
    kind = _kind(status, words)
    fault = kind(message, None if kind is PermanentFault else retry_after(headers))
    # Nothing is billed if no connection was made or the server sent an error status.
    fault.billed = status == 200 and not _unsent(error)
    return fault


def _kind(status: int, words: set[str]) -> type[ProviderFault]:
    if words & PERMANENT_WORDS and status in {200, 429}:
        return PermanentFault
    if status == 429 or (status == 200 and words & LIMITED_WORDS):
        return RateLimited
    if 300 <= status < 500 and status not in TRANSIENT_STATUS:
        return PermanentFault
    return ProviderFault


def _unsent(error: BaseException | None) -> bool:
    """Whether the question was not sent because no connection was made."""
    import httpx2

    if error is None:
        return False
    unsent = isinstance(error, httpx2.ConnectError | httpx2.ConnectTimeout)
    return unsent or _unsent(error.__cause__)


def _parse_body(body: object) -> tuple[set[str], str]:
    """Returns type and code in the body of an error, and its message."""
    inner = body.get("error", body) if isinstance(body, dict) else body
    if not isinstance(inner, dict):
        return set(), inner if isinstance(inner, str) else ""
    words = {_word(inner.get(key)) for key in ("type", "code")} - {""}
    return words, _word(inner.get("message"))


def _word(value: object) -> str:
    """Returns a text or a small number in the body of an error; else nothing."""
    if isinstance(value, int) and not isinstance(value, bool):
        return str(value) if 0 < value < 10**9 else ""
    return value if isinstance(value, str) else ""


def _message(
    error: Exception, status: int, words: set[str], text: str, headers: Headers
) -> str:
    """Returns one line: status, type and code, message, and the vendor's request ID."""
    number = "" if status == 200 else str(status)
    if not (words or number):
        text = text or _root_cause(error)
    parts = [number, " ".join(sorted(words)), text or type(error).__name__]
    line = ": ".join(part for part in parts if part)
    request_id = headers.get("request-id") or headers.get("x-request-id")
    return one_line(f"{line} (request {request_id})" if request_id else line)


def _root_cause(error: Exception) -> str:
    """Describes an error that the server did not send, by its innermost cause."""
    reason = error
    while isinstance(reason.__cause__, Exception) and str(reason.__cause__):
        reason = reason.__cause__
    name, text = type(error).__name__, str(reason)
    return f"{name}: {text}" if text else name


def retry_after(headers: Headers, now: datetime | None = None) -> float | None:
    """Returns the wait that a server asks for, s; None if it asks for none.

    Args:
        headers: Response headers; `retry-after` may be seconds or a date.
        now: Current time, for dates; by default that of the clock.
    """
    for name, unit in (("retry-after-ms", 1e-3), ("retry-after", 1.0)):
        text = headers.get(name, "").strip()
        seconds = _number(text) if text else None
        if seconds is not None:
            return seconds * unit
        if text and unit == 1.0:
            return _until(text, now or datetime.now(UTC))
    return None


def _number(text: str) -> float | None:
    try:
        seconds = float(text)
    except ValueError:
        return None
    return seconds if math.isfinite(seconds) and seconds >= 0 else None


def _until(text: str, now: datetime) -> float | None:
    try:
        date = parsedate_to_datetime(text)
        # A date without a time zone is taken as UTC.
        return max(0.0, (date.replace(tzinfo=date.tzinfo or UTC) - now).total_seconds())
    except (ValueError, TypeError, OverflowError):
        return None


@contextmanager
def as_faults(known: tuple[type[Exception], ...]) -> Generator[None]:
    """Turns errors of a vendor's package into faults without a traceback.

    Args:
        known: Errors of the package and of its HTTP library.

    Raises:
        ProviderFault: Replaces these errors, and those that a malformed answer causes.
    """
    # The packages validate little: a malformed answer shows as whatever error their
    # code then raises.
    malformed = (ValueError, TypeError, AttributeError, LookupError, AssertionError)
    try:
        yield
    except known as error:
        raise fault_of(error) from None
    except RecursionError:
        raise ProviderFault("malformed answer: it is nested too deeply") from None
    except malformed as error:
        reason = one_line(f"malformed answer ({type(error).__name__}: {error})")
        raise ProviderFault(reason) from None
