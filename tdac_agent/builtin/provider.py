"""`builtin`: no language model; see `tdac_agent.builtin`."""

from __future__ import annotations

from tdac_agent.builtin import builtin_for
from tdac_agent.errors import ProviderError
from tdac_agent.models.choice import Options
from tdac_agent.models.provider import Provider


def make_builtin(words: str, options: Options) -> Provider:
    """The template that is tuned by what failed.

    Raises:
        ProviderError: It was given words, and takes none.
    """
    if words:
        raise ProviderError(f"'builtin' has no models; got 'builtin:{words}'")
    return builtin_for(options.setting)
