"""`anthropic:MODEL`, by the official package."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING

from tdac_agent.errors import ProviderError
from tdac_agent.provider import Reply, Request
from tdac_agent.providers.choice import Options
from tdac_agent.providers.faults import as_faults
from tdac_agent.providers.gathered import Gathered, Stop, count
from tdac_agent.providers.patience import CONNECT_SECONDS, STALL_SECONDS, within
from tdac_agent.providers.secrets import read_key

if TYPE_CHECKING:
    import anthropic
    from anthropic.types import RawMessageStreamEvent, TextBlockParam

KEY = "ANTHROPIC_API_KEY"
STOPS: dict[str, Stop] = {
    "end_turn": "end",
    "stop_sequence": "end",
    "max_tokens": "length",
    "model_context_window_exceeded": "length",
    "refusal": "refusal",
}


def make(words: str, options: Options) -> AnthropicModel:
    """A model of Anthropic, or of a server that speaks its language.

    Raises:
        ProviderError: The package, the key or the model's name is missing.
    """
    if not words:
        raise ProviderError("which model? As in anthropic:claude-sonnet-5-5")
    try:
        import anthropic  # noqa: F401
    except ImportError as error:
        raise ProviderError(
            f'anthropic:{words} needs a package: pip install "tdac[anthropic]"'
        ) from error
    base_url = options.base_url or os.environ.get("ANTHROPIC_BASE_URL") or None
    model = AnthropicModel(words, base_url)
    read_key(KEY, "Anthropic", needed=base_url is None)
    return model


class AnthropicModel:
    """A provider; see `Provider`. The key is read at each call, and not kept.

    Args:
        model: Its id.
        base_url: Of the server; None for Anthropic's own.
        stall: Seconds of silence after which the connection is given up.
    """

    paid = True

    def __init__(
        self, model: str, base_url: str | None, stall: float = STALL_SECONDS
    ) -> None:
        self.name = f"anthropic:{model}"
        self._model = model
        self._base_url = base_url
        self._stall = stall

    def complete(self, request: Request) -> Reply:
        """Answers one request; see `Provider`."""
        client = self._client()
        with client:
            return within(
                request.seconds, lambda: self._ask(client, request), client.close
            )

    def _client(self) -> anthropic.Anthropic:
        import anthropic

        return anthropic.Anthropic(
            api_key=read_key(KEY, "Anthropic", needed=self._base_url is None),
            base_url=self._base_url,
            max_retries=0,
            timeout=anthropic.Timeout(self._stall, connect=CONNECT_SECONDS),
            # A redirect might take prompt and key elsewhere.
            http_client=anthropic.DefaultHttpxClient(follow_redirects=False),
        )

    def _ask(self, client: anthropic.Anthropic, request: Request) -> Reply:
        import anthropic
        import httpx2

        gathered = Gathered(STOPS)
        with as_faults((anthropic.AnthropicError, httpx2.HTTPError)):
            with client.messages.create(
                model=self._model,
                max_tokens=request.max_tokens,
                messages=[{"role": "user", "content": _content(request)}],
                stream=True,
            ) as stream:
                gathered.request_id = stream.response.headers.get("request-id")
                for event in stream:
                    _gather(gathered, event)
            return gathered.reply()


def _content(request: Request) -> list[TextBlockParam]:
    """The prompt's parts; what is the same in all of a run is to be cached."""
    blocks: list[TextBlockParam] = [
        {"type": "text", "text": part} for part in request.parts
    ]
    if len(blocks) > 1:
        blocks[0]["cache_control"] = {"type": "ephemeral"}
    return blocks


def _gather(gathered: Gathered, event: RawMessageStreamEvent) -> None:
    if event.type == "message_start":
        gathered.model = event.message.model
        _count(gathered, event.message.usage)
    elif event.type == "content_block_start":
        if event.content_block.type == "text":
            gathered.add(event.content_block.text)
    elif event.type == "content_block_delta":
        if event.delta.type == "text_delta":
            gathered.add(event.delta.text)
    elif event.type == "message_delta":
        gathered.reason = event.delta.stop_reason or gathered.reason
        _count(gathered, event.usage)


def _count(
    gathered: Gathered, usage: anthropic.types.Usage | anthropic.types.MessageDeltaUsage
) -> None:
    """Takes over what is reported: the numbers are of the whole answer so far."""
    if usage.input_tokens is not None:
        gathered.tokens_cached = count(usage.cache_read_input_tokens)
        gathered.tokens_written = count(usage.cache_creation_input_tokens)
        cached = gathered.tokens_cached + gathered.tokens_written
        gathered.tokens_in = count(usage.input_tokens) + cached
    gathered.tokens_out = count(usage.output_tokens)
