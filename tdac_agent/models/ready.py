"""What a run needs of its models, checked before a task is loaded or code compiled."""

from __future__ import annotations

import functools
import socket
from collections.abc import Iterable, Mapping
from typing import Any
from urllib.parse import urlsplit
from urllib.request import getproxies, proxy_bypass

from tdac_agent.errors import Fault
from tdac_agent.models.choice import (
    OFFLINE,
    Options,
    check_names,
    choose_model,
    needs_task,
)
from tdac_agent.models.provider import Provider, ProviderFault, served_at
from tdac_agent.models.tariff import bounds_of, tariffs_of
from tdac_agent.models.timeout import run_with_timeout
from tdac_agent.storage.secrets import is_loopback, one_line

CONNECT_SECONDS = 5.0


def check_ready(names: Iterable[str | None], wanted: Mapping[str, Any]) -> None:
    """Checks the models of a run: names, keys, packages, prices, servers.

    A provider that looks at the task is made later, with the task.

    Args:
        names: The models; None for no further one.
        wanted: May have `base_url`, `key_over_http`, `max_cost` and `max_tokens`, as
            for `synthesize`.

    Raises:
        ProviderError: A model cannot be used; the message lists all that is missing.
        PriceError: The user's price file is broken.
        Fault: A server does not answer.
    """
    known = [name for name in dict.fromkeys(names) if name is not None]
    base_url = wanted.get("base_url")
    check_names(known, base_url)
    options = Options(None, base_url, wanted.get("key_over_http", False))
    models = [choose_model(name, options) for name in known if not needs_task(name)]
    limits = (wanted.get("max_cost"), wanted.get("max_tokens"))
    bounds_of(models, tariffs_of(models), *limits)
    check_servers(models)


def check_servers(models: Iterable[Provider]) -> None:
    """Checks that the models' own servers accept connections; sends them nothing.

    The vendors' servers are not tried, nor those behind a proxy, nor one again that has
    accepted a connection of this process.

    Raises:
        Fault: A server does not; the message lists all of them.
    """
    problems = []
    for model in {served_at(model): model for model in models}.values():
        url = served_at(model)
        try:
            if url is not None and not _is_proxied(url):
                connect(url)
        except (ProviderFault, OSError, ValueError) as error:
            reason = one_line(getattr(error, "strerror", None) or str(error))
            problems.append(
                f"no server answers at {url} ({reason}), which {model.name} needs: "
                "start it, or correct the base URL"
            )
    if problems:
        raise Fault("; ".join(problems))


def needs_limit(name: str, base_url: str | None) -> bool:
    """Whether a limit must bound what a model costs; not on a server of this machine.

    Args:
        name: The model.
        base_url: URL of the models' server.

    Raises:
        ProviderError: The name is unknown, or cannot be used.
    """
    check_names([name], None)
    if name.partition(":")[0] in OFFLINE:
        return False
    other = needs_task(name)
    url = None if other else served_at(choose_model(name, Options(None, base_url)))
    return url is None or not is_loopback(url)


def _is_proxied(url: str) -> bool:
    parts = urlsplit(url)
    proxied = not getproxies().keys().isdisjoint((parts.scheme, "all"))
    return not is_loopback(url) and proxied and not proxy_bypass(parts.hostname or "")


@functools.cache
def connect(url: str) -> None:
    """Connects to a server, and closes the connection; a success is remembered.

    Raises:
        ProviderFault: It takes too long.
        OSError: There is no connection.
        ValueError: The URL is not valid.
    """
    parts = urlsplit(url)
    port = parts.port or (443 if parts.scheme == "https" else 80)
    address = parts.hostname or "", port
    # A name server may take longer than the connection.
    run_with_timeout(
        CONNECT_SECONDS,
        lambda: socket.create_connection(address, CONNECT_SECONDS).close(),
        lambda: None,
    )
