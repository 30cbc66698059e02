"""`openai:MODEL`, by the official package: of OpenAI, or of a server that is alike."""

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
    import openai
    from openai.types.chat import ChatCompletionChunk

KEY = "OPENAI_API_KEY"
STOPS: dict[str, Stop] = {
    "stop": "end",
    "length": "length",
    "eos": "end",  # of some servers that are alike
    "content_filter": "refusal",
}


def make(words: str, options: Options) -> OpenAIModel:
    """A model of OpenAI, or of a server that speaks its language.

    Raises:
        ProviderError: The package, the key or the model's name is missing.
    """
    if not words:
        raise ProviderError("which model? As in openai:gpt-6-sol")
    try:
        import openai  # noqa: F401
    except ImportError as error:
        raise ProviderError(
            f'openai:{words} needs a package: pip install "tdac[openai]"'
        ) from error
    base_url = options.base_url or os.environ.get("OPENAI_BASE_URL") or None
    model = OpenAIModel(words, base_url)
    read_key(KEY, "OpenAI", needed=base_url is None)
    return model


class OpenAIModel:
    """A provider; see `Provider`. The key is read at each call, and not kept.

    Args:
        model: Its id.
        base_url: Of the server; None for OpenAI's own.
        stall: Seconds of silence after which the connection is given up.
    """

    paid = True

    def __init__(
        self, model: str, base_url: str | None, stall: float = STALL_SECONDS
    ) -> None:
        self.name = f"openai:{model}"
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

    def _client(self) -> openai.OpenAI:
        import openai

        return openai.OpenAI(
            api_key=read_key(KEY, "OpenAI", needed=self._base_url is None),
            base_url=self._base_url,
            max_retries=0,
            timeout=openai.Timeout(self._stall, connect=CONNECT_SECONDS),
            # A redirect might take prompt and key elsewhere.
            http_client=openai.DefaultHttpxClient(follow_redirects=False),
        )

    def _ask(self, client: openai.OpenAI, request: Request) -> Reply:
        import httpx2
        import openai

        # Local servers know the older name of the limit only, OpenAI the newer one.
        own = self._base_url is None
        gathered = Gathered(STOPS)
        with as_faults((openai.OpenAIError, httpx2.HTTPError)):
            with client.chat.completions.create(
                model=self._model,
                messages=[{"role": "user", "content": request.prompt}],
                max_completion_tokens=request.max_tokens if own else openai.omit,
                max_tokens=openai.omit if own else request.max_tokens,
                stream=True,
                stream_options={"include_usage": True},
            ) as stream:
                gathered.request_id = stream.response.headers.get("x-request-id")
                for chunk in stream:
                    _gather(gathered, chunk)
            return gathered.reply()


def _gather(gathered: Gathered, chunk: ChatCompletionChunk) -> None:
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
        gathered.tokens_in = count(chunk.usage.prompt_tokens)
        gathered.tokens_out = count(chunk.usage.completion_tokens)
        if details is not None:
            gathered.tokens_cached = count(details.cached_tokens)
            gathered.tokens_written = count(details.cache_write_tokens)
