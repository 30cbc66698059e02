"""The interface of a controller writer: a language model or `builtin`.

The public names of `tdac_agent.models.provider`.
"""

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
