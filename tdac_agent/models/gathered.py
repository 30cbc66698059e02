"""An answer that comes in pieces."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

from tdac_agent.models.provider import ProviderFault, Reply
from tdac_agent.storage.secrets import one_line, without_secrets

MAX_CHARS = 2_000_000
Stop = Literal["end", "length", "refusal"]


@dataclass(slots=True)
class Gathered:
    """What has come of an answer so far.

    Attributes:
        stops: What each reason to stop of the vendor means.
        pieces: Of the text.
        reason: Why the model stopped, in the vendor's word, once it is said.
        model: As reported.
        request_id: As reported.
        tokens_in: As reported, cached ones included.
        tokens_out: As reported.
        tokens_cached: Read from the cache, as reported.
        tokens_written: Written to it.
        refused: Whether the text is a refusal, for whatever reason it stops.
    """

    stops: Mapping[str, Stop]
    pieces: list[str] = field(default_factory=list)
    reason: str | None = None
    model: object = None
    request_id: str | None = None
    tokens_in: int = 0
    tokens_out: int = 0
    tokens_cached: int = 0
    tokens_written: int = 0
    refused: bool = False
    _chars: int = 0

    def add(self, text: object) -> None:
        """Appends a piece of the text.

        Raises:
            ProviderFault: It is none, or more than any answer may have.
        """
        if not isinstance(text, str):
            raise ProviderFault("malformed answer: a piece of the text is no text")
        self._chars += len(text)
        if self._chars > MAX_CHARS:
            raise ProviderFault(f"the answer has more than {MAX_CHARS} characters")
        self.pieces.append(text)

    def reply(self) -> Reply:
        """The whole answer.

        Raises:
            ProviderFault: It ended without a reason that is known: it may be cut.
        """
        if self.reason is None:
            chars = f"{self._chars} characters"
            raise ProviderFault(f"the answer ended after {chars} without a stop reason")
        if self.reason not in self.stops:
            raise ProviderFault(f"unknown stop reason {one_line(self.reason)!r}")
        return Reply(
            text=without_secrets("".join(self.pieces)),
            stop="refusal" if self.refused else self.stops[self.reason],
            tokens_in=self.tokens_in,
            tokens_out=self.tokens_out,
            tokens_cached=self.tokens_cached,
            tokens_written=self.tokens_written,
            model=one_line(self.model) if isinstance(self.model, str) else None,
            request_id=one_line(self.request_id) if self.request_id else None,
        )


def count(value: object) -> int:
    """A number of tokens, 0 where none is reported."""
    return value if isinstance(value, int) and value > 0 else 0
