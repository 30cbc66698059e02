"""Models of Anthropic, through the official package."""

from __future__ import annotations

from typing import TYPE_CHECKING

from tdac_agent.models.bounds import check_count
from tdac_agent.models.faults import as_faults
from tdac_agent.models.provider import Reply, Request
from tdac_agent.models.streamed import Stop, StreamedAnswer
from tdac_agent.models.vendor_model import VendorModel
from tdac_agent.models.vendors import VENDORS

if TYPE_CHECKING:
    import anthropic
    from anthropic.types import RawMessageStreamEvent, TextBlockParam

STOPS: dict[str, Stop] = {
    "end_turn": "end",
    "stop_sequence": "end",
    "max_tokens": "length",
    "model_context_window_exceeded": "length",
    "refusal": "refusal",
}


class AnthropicModel(VendorModel["anthropic.Anthropic"]):
    """A model of Anthropic, or of a server with a compatible API."""

    usual = VENDORS["anthropic"]

    def _ask(self, client: anthropic.Anthropic, request: Request) -> Reply:
        import anthropic
        import httpx2

        gathered = StreamedAnswer(STOPS)
        with as_faults((anthropic.AnthropicError, httpx2.HTTPError)):
            with client.messages.create(
                model=self._model,
                max_tokens=request.max_tokens,
                messages=[{"role": "user", "content": _content(request)}],
                stream=True,
            ) as stream:
                gathered.request_id = stream.response.headers.get("request-id")
                for event in stream:
                    _add_event(gathered, event)
            return gathered.reply()


def _content(request: Request) -> list[TextBlockParam]:
    """Returns the prompt's parts; the stable one is marked for caching."""
    blocks: list[TextBlockParam] = [
        {"type": "text", "text": part} for part in request.parts
    ]
    if len(blocks) > 1:
        blocks[0]["cache_control"] = {"type": "ephemeral"}
    return blocks


def _add_event(gathered: StreamedAnswer, event: RawMessageStreamEvent) -> None:
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
    gathered: StreamedAnswer,
    usage: anthropic.types.Usage | anthropic.types.MessageDeltaUsage,
) -> None:
    """Stores the reported token counts, which cover the whole answer so far."""
    if usage.input_tokens is not None:
        gathered.tokens_cached = check_count(usage.cache_read_input_tokens)
        gathered.tokens_written = check_count(usage.cache_creation_input_tokens)
        cached = gathered.tokens_cached + gathered.tokens_written
        gathered.tokens_in = check_count(usage.input_tokens) + cached
    gathered.tokens_out = check_count(usage.output_tokens)
