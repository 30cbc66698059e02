"""What a run needs of its models, checked before a task is loaded or code compiled."""

from __future__ import annotations

import socket
from collections.abc import Iterable, Mapping
from typing import Any
from urllib.parse import urlsplit
from urllib.request import getproxies, proxy_bypass

from tdac_agent.errors import Fault
from tdac_agent.models.choice import WITHOUT_TASK, Options, check_names, choose_model
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
    models = [
        choose_model(name, options)
        for name in known
        if name.partition(":")[0] in WITHOUT_TASK
    ]
    limits = (wanted.get("max_cost"), wanted.get("max_tokens"))
    bounds_of(models, tariffs_of(models), *limits)
    check_servers(models)


def check_servers(models: Iterable[Provider]) -> None:
    """Checks that the models' own servers accept connections; sends them nothing.

    The vendors' servers are not tried, nor those behind a proxy.

    Raises:
        Fault: A server does not; the message lists all of them.
    """
    problems = []
    for model in {served_at(model): model for model in models}.values():
        url = served_at(model)
        problem = None if url is None else _unreachable(url)
        if problem is not None:
            problems.append(
                f"no server answers at {url} ({problem}), which {model.name} needs: "
                "start it, or correct the base URL"
            )
    if problems:
        raise Fault("; ".join(problems))


def _unreachable(url: str) -> str | None:
    """Says why there is no connection to a server; None if there is one."""
    parts = urlsplit(url)
    host = parts.hostname or ""
    proxied = not getproxies().keys().isdisjoint((parts.scheme, "all"))
    if not is_loopback(url) and proxied and not proxy_bypass(host):
        return None

    def connect() -> None:
        port = parts.port or (443 if parts.scheme == "https" else 80)
        socket.create_connection((host, port), CONNECT_SECONDS).close()

    try:
        # A name server may take longer than the connection.
        run_with_timeout(CONNECT_SECONDS, connect, lambda: None)
    except ProviderFault:
        return f"no connection within {CONNECT_SECONDS:g} s"
    except (OSError, ValueError) as error:
        return one_line(getattr(error, "strerror", None) or str(error))
    return None
