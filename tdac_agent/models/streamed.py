"""Assemble an answer that is streamed in pieces."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

from tdac_agent.models.bounds import MAX_CHARS
from tdac_agent.models.provider import ProviderFault, Reply
from tdac_agent.storage.secrets import one_line, without_secrets

Stop = Literal["end", "length", "refusal"]


@dataclass(slots=True)
class StreamedAnswer:
    """The parts of an answer received so far; all numbers as the vendor reports them.

    Attributes:
        stops: Our name for each stop reason of the vendor.
        pieces: Pieces of the text.
        reason: The vendor's stop reason, None until it is received.
        model: The model's name, as reported.
        request_id: The vendor's ID of the request.
        tokens_in: Input tokens, cached ones included.
        tokens_out: Output tokens.
        tokens_cached: Input tokens read from the cache.
        tokens_written: Input tokens written to the cache.
        refused: Whether the text is a refusal, whatever the stop reason.
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
            ProviderFault: The piece is not a string, or the answer is too long.
        """
        if not isinstance(text, str):
            raise ProviderFault("malformed answer: a piece of the text is not a string")
        self._chars += len(text)
        if self._chars > MAX_CHARS:
            raise ProviderFault(f"the answer has more than {MAX_CHARS} characters")
        self.pieces.append(text)

    def reply(self) -> Reply:
        """Returns the whole answer.

        Raises:
            ProviderFault: Without a known stop reason, the answer may be truncated.
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
