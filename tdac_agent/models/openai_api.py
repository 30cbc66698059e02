"""Models of OpenAI, and of servers with its API, through the official package."""

from __future__ import annotations

from typing import TYPE_CHECKING

from tdac_agent.models.bounds import check_count
from tdac_agent.models.faults import as_faults
from tdac_agent.models.provider import Reply, Request
from tdac_agent.models.streamed import Stop, StreamedAnswer
from tdac_agent.models.vendor_model import VendorModel
from tdac_agent.models.vendors import VENDORS

if TYPE_CHECKING:
    import openai
    from openai.types.chat import ChatCompletionChunk

STOPS: dict[str, Stop] = {
    "stop": "end",
    "length": "length",
    "eos": "end",  # sent by some compatible servers
    "content_filter": "refusal",
}


class OpenAIModel(VendorModel["openai.OpenAI"]):
    """A model of OpenAI, or of a server with a compatible API."""

    usual = VENDORS["openai"]

    def _ask(self, client: openai.OpenAI, request: Request) -> Reply:
        import httpx2
        import openai

        # Other servers know only the older name of the limit; OpenAI needs the newer.
        is_openai = self._url is None
        gathered = StreamedAnswer(STOPS)
        with as_faults((openai.OpenAIError, httpx2.HTTPError)):
            with client.chat.completions.create(
                model=self._model,
                messages=[{"role": "user", "content": request.prompt}],
                max_completion_tokens=request.max_tokens if is_openai else openai.omit,
                max_tokens=openai.omit if is_openai else request.max_tokens,
                stream=True,
                stream_options={"include_usage": True},
            ) as stream:
                gathered.request_id = stream.response.headers.get("x-request-id")
                for chunk in stream:
                    _add_chunk(gathered, chunk)
            return gathered.reply()


def _add_chunk(gathered: StreamedAnswer, chunk: ChatCompletionChunk) -> None:
    gathered.model = chunk.model or gathered.model
    for choice in chunk.choices or ():
        if choice.delta and choice.delta.content:
            gathered.add(choice.delta.content)
        if choice.delta and choice.delta.refusal:
            gathered.add(choice.delta.refusal)
            gathered.refused = True
        gathered.reason = choice.finish_reason or gathered.reason
    if chunk.usage is not None:
        details = chunk.usage.prompt_tokens_details
        gathered.tokens_in = check_count(chunk.usage.prompt_tokens)
        gathered.tokens_out = check_count(chunk.usage.completion_tokens)
        if details is not None:
            gathered.tokens_cached = check_count(details.cached_tokens)
            gathered.tokens_written = check_count(details.cache_write_tokens)
