"""The interface of a controller writer: a language model or `builtin`.

The public names of `tdac_agent.models.provider` and `picture`.
"""

from tdac_agent.models.picture import Picture
from tdac_agent.models.provider import (
    ANSWER_SECONDS,
    MAX_OUTPUT_TOKENS,
    Kind,
    PermanentFault,
    Provider,
    ProviderFault,
    RateLimited,
    Reply,
    Request,
    Role,
    missing_for,
    recorded_seed,
    served_at,
)

__all__ = [
    "ANSWER_SECONDS",
    "MAX_OUTPUT_TOKENS",
    "Kind",
    "PermanentFault",
    "Picture",
    "Provider",
    "ProviderFault",
    "RateLimited",
    "Reply",
    "Request",
    "Role",
    "missing_for",
    "recorded_seed",
    "served_at",
]
