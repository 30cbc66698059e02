"""The vendors of models: one entry each, from which everything else about them follows.

A service with the API of another vendor is an entry with its `url`:

    Vendor("acme", "Acme", OPENAI, example="acme-1", url="https://api.acme.example/v1")

Then `acme:MODEL` is a model. Its key is in ACME_API_KEY, and ACME_BASE_URL names
another server. Its price is that of `acme:MODEL` in `prices.yaml`; a model that is not
listed there is refused without `--max-tokens`.
"""

from __future__ import annotations

import os
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Api:
    """A way to ask models, through a vendor's Python package.

    Attributes:
        package: The package.
        extra: Extra of tdac that installs it; None if every installation has it.
        client: Class of a client in the package.
        model: Subclass of `VendorModel`, as `module:class`; it is imported when a model
            is chosen.
    """

    package: str
    extra: str | None
    client: str
    model: str


@dataclass(frozen=True, slots=True)
class Vendor:
    """A vendor of models.

    Attributes:
        name: What precedes the colon in the names of its models.
        company: Its name in messages.
        api: How its models are asked.
        example: Example of a model ID.
        url: URL of its server; None for the one that the package knows.
        serves: Words that the studio adds to "a model of COMPANY".
    """

    name: str
    company: str
    api: Api
    example: str
    url: str | None = None
    serves: str = ""

    @property
    def key(self) -> str:
        """Environment variable of the key."""
        return f"{self._variable}_API_KEY"

    @property
    def base_url(self) -> str:
        """Environment variable of another server's URL."""
        return f"{self._variable}_BASE_URL"

    def server(self, base_url: str | None) -> str | None:
        """The server that answers: the given one, or that of `base_url`'s variable.

        None for the vendor's own.
        """
        return base_url or os.environ.get(self.base_url) or None

    @property
    def _variable(self) -> str:
        return self.name.upper().replace("-", "_")


ANTHROPIC = Api(
    "anthropic",
    None,
    "Anthropic",
    "tdac_agent.models.anthropic_api:AnthropicModel",
)
OPENAI = Api(
    "openai",
    "openai",
    "OpenAI",
    "tdac_agent.models.openai_api:OpenAIModel",
)

VENDORS = {
    each.name: each
    for each in (
        Vendor("anthropic", "Anthropic", ANTHROPIC, example="claude-sonnet-5-5"),
        Vendor(
            "openai",
            "OpenAI",
            OPENAI,
            example="gpt-6-sol",
            serves=", or of a server with its API",
        ),
    )
}
"""The vendors, by the prefix of their models' names."""


def vendor_of(model: str) -> Vendor | None:
    """Returns the vendor of a model by its name; None if it has none."""
    return VENDORS.get(model.partition(":")[0])


def forms(mark: str = "") -> tuple[str, ...]:
    """Returns the forms of the vendors' names, such as `anthropic:MODEL`.

    Args:
        mark: What stands before and after each, such as a backtick.
    """
    return tuple(f"{mark}{name}:MODEL{mark}" for name in VENDORS)
