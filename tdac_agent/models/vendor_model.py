"""The common base of models that are asked through a vendor's official package."""

from __future__ import annotations

import importlib
import importlib.util
from abc import ABC, abstractmethod
from pkgutil import resolve_name
from typing import Any, ClassVar, Generic, TypeVar

from tdac_agent.errors import ProviderError
from tdac_agent.models.choice import Options
from tdac_agent.models.provider import PermanentFault, Reply, Request
from tdac_agent.models.timeout import CONNECT_SECONDS, STALL_SECONDS, run_with_timeout
from tdac_agent.models.vendors import Vendor
from tdac_agent.storage.secrets import (
    NO_KEY,
    is_safe_for_keys,
    one_line,
    public_url,
    read_key,
)
from tdac_envs.core.extras import install_command

C = TypeVar("C")


class VendorModel(ABC, Generic[C]):
    """A vendor's model; see `Provider`. The key is read at each call and not stored.

    Args:
        model: Model ID.
        base_url: URL of another server; None for the vendor's own.
        stall: Seconds of silence after which the connection is given up.
        vendor: Whose model it is; by default the vendor of the API.
        key_over_http: Whether the key may go to another machine unencrypted.
    """

    usual: ClassVar[Vendor]
    paid = True
    concurrent = True

    def __init__(
        self,
        model: str,
        base_url: str | None,
        stall: float = STALL_SECONDS,
        *,
        vendor: Vendor | None = None,
        key_over_http: bool = False,
    ) -> None:
        self.vendor = vendor or self.usual
        self.name = f"{self.vendor.name}:{model}"
        self._model = model
        self._base_url = base_url
        self._url = base_url or self.vendor.url
        self.served_at = None if base_url is None else public_url(base_url)
        self._stall = stall
        self._key_over_http = key_over_http

    @property
    def missing(self) -> tuple[str, ...]:
        """A line each for the package and the key, if they are missing."""
        api, missing = self.vendor.api, []
        # The import takes a second or two, so it is left to the first question.
        if importlib.util.find_spec(api.package) is None:
            install = install_command(api.extra)
            missing.append(f"{self.name} needs a package: {install}")
        try:
            self._read_key()
        except ProviderError as error:
            missing.append(str(error))
        return tuple(missing)

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
            http = package.DefaultHttpxClient(**client_options(self._url))
        # The environment names a proxy that is invalid, or needs another package.
        except (ImportError, ValueError) as error:
            raise PermanentFault(one_line(f"the proxy: {error}")) from None
        client = getattr(package, self.vendor.api.client)
        return client(
            api_key=self._read_key(),
            base_url=self._url,
            max_retries=0,
            timeout=package.Timeout(self._stall, connect=CONNECT_SECONDS),
            http_client=http,
        )

    def _package(self) -> Any:
        package = self.vendor.api.package
        try:
            return importlib.import_module(package)
        except ImportError as error:
            raise PermanentFault(one_line(f"{package}: {error}")) from error

    def _read_key(self) -> str:
        vendor, url = self.vendor, self._url
        key = read_key(vendor.key, vendor.company, needed=self._base_url is None)
        if url is None or key == NO_KEY or self._key_over_http:
            return key
        if not is_safe_for_keys(url):
            raise ProviderError(
                f"the key in {vendor.key} would go unencrypted to {public_url(url)}: "
                "use https, unset the variable, or allow it with --key-over-http"
            )
        return key


def make_model(vendor: Vendor, words: str, options: Options) -> VendorModel[Any]:
    """Returns a model of a vendor or of a compatible server.

    Package and key may still be missing; see `VendorModel.missing`.

    Args:
        vendor: The vendor.
        words: The model ID.
        options: Options of the choice.

    Raises:
        ProviderError: No model is named.
    """
    if not words:
        example = f"{vendor.name}:{vendor.example}"
        raise ProviderError(f"{vendor.name}: needs a model, as in {example}")
    model: type[VendorModel[Any]] = resolve_name(vendor.api.model)
    base_url = vendor.server(options.base_url)
    return model(words, base_url, vendor=vendor, key_over_http=options.key_over_http)
