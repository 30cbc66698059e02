"""The common base of models that are asked through a vendor's official package."""

from __future__ import annotations

import importlib
import importlib.util
import os
from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Any, ClassVar, Generic, TypeVar

from tdac_agent.errors import ProviderError
from tdac_agent.models.choice import Options
from tdac_agent.models.provider import PermanentFault, Reply, Request
from tdac_agent.models.timeout import CONNECT_SECONDS, STALL_SECONDS, run_with_timeout
from tdac_agent.storage.secrets import (
    NO_KEY,
    is_safe_for_keys,
    one_line,
    public_url,
    read_key,
)
from tdac_envs.core.extras import install_command

C = TypeVar("C")


@dataclass(frozen=True, slots=True)
class Vendor:
    """A vendor of models.

    Attributes:
        package: Its Python package, also the prefix of model names.
        extra: Extra that installs the package; None if every installation has it.
        client: Class of a client in the package.
        company: Its name in messages.
        key: Environment variable of the key.
        base_url: Environment variable of another server's URL.
        example: Example of a model ID.
    """

    package: str
    extra: str | None
    client: str
    company: str
    key: str
    base_url: str
    example: str


class VendorModel(ABC, Generic[C]):
    """A vendor's model; see `Provider`. The key is read at each call and not stored.

    Args:
        model: Model ID.
        base_url: URL of the server; None for the vendor's own.
        stall: Seconds of silence after which the connection is given up.
        key_over_http: Whether the key may go to another machine unencrypted.
    """

    vendor: ClassVar[Vendor]
    paid = True
    concurrent = True

    def __init__(
        self,
        model: str,
        base_url: str | None,
        stall: float = STALL_SECONDS,
        *,
        key_over_http: bool = False,
    ) -> None:
        self.name = f"{self.vendor.package}:{model}"
        self._model = model
        self._base_url = base_url
        self.served_at = None if base_url is None else public_url(base_url)
        self._stall = stall
        self._key_over_http = key_over_http

    @property
    def missing(self) -> tuple[str, ...]:
        """A line each for the package and the key, if they are missing."""
        vendor, missing = self.vendor, []
        # The import takes a second or two, so it is left to the first question.
        if importlib.util.find_spec(vendor.package) is None:
            install = install_command(vendor.extra)
            missing.append(f"{self.name} needs a package: {install}")
        try:
            self._read_key()
        except ProviderError as error:
            missing.append(str(error))
        return tuple(missing)

    @classmethod
    def make(cls, words: str, options: Options) -> VendorModel[C]:
        """Returns a model of the vendor or of a compatible server.

        Package and key may still be missing; see `missing`.

        Raises:
            ProviderError: No model is named.
        """
        vendor = cls.vendor
        if not words:
            example = f"{vendor.package}:{vendor.example}"
            raise ProviderError(f"{vendor.package}: needs a model, as in {example}")
        base_url = options.base_url or os.environ.get(vendor.base_url) or None
        return cls(words, base_url, key_over_http=options.key_over_http)

    def complete(self, request: Request) -> Reply:
        """Answers one request; see `Provider`."""
        with self._new_client() as client:
            return run_with_timeout(
                request.seconds, lambda: self._ask(client, request), client.close
            )

    @abstractmethod
    def _ask(self, client: C, request: Request) -> Reply:
        """Sends the request and assembles the streamed answer."""

    def _new_client(self) -> Any:
        package = self._package()
        from tdac_agent.models.transport import client_options

        try:
            http = package.DefaultHttpxClient(**client_options(self._base_url))
        # The environment names a proxy that is invalid, or needs another package.
        except (ImportError, ValueError) as error:
            raise PermanentFault(one_line(f"the proxy: {error}")) from None
        client = getattr(package, self.vendor.client)
        return client(
            api_key=self._read_key(),
            base_url=self._base_url,
            max_retries=0,
            timeout=package.Timeout(self._stall, connect=CONNECT_SECONDS),
            http_client=http,
        )

    def _package(self) -> Any:
        try:
            return importlib.import_module(self.vendor.package)
        except ImportError as error:
            raise PermanentFault(one_line(f"{self.vendor.package}: {error}")) from error

    def _read_key(self) -> str:
        vendor = self.vendor
        url = self._base_url
        key = read_key(vendor.key, vendor.company, needed=url is None)
        if key != NO_KEY and not (self._key_over_http or is_safe_for_keys(url)):
            raise ProviderError(
                f"the key in {vendor.key} would go unencrypted to {self.served_at}: "
                "use https, unset the variable, or allow it with --key-over-http"
            )
        return key
