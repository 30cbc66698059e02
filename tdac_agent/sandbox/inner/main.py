"""Entry point of the child: read the setup, drop privileges, serve."""

from __future__ import annotations

import os
import sys

from .confine import confine
from .decode import decode
from .encode import encode
from .link import Link
from .serve import Server
from .wire import Kind


def main(requests: int, answers: int, lifeline: int, site: str) -> None:
    """Serve the judge on two descriptors until the judge closes them.

    Args:
        requests: Descriptor to read requests from.
        answers: Descriptor to write answers to.
        lifeline: Descriptor that must stay open.
        site: Folder from which numpy is imported.
    """
    link = Link(requests, answers)
    _, sequence, payload = link.receive()
    setup = decode(payload)
    ours = {"descriptors": [requests, answers], "lifeline": lifeline}
    sys.argv = ["controller.py"]
    os.environ.update(HOME=setup["scratch"], TMPDIR=setup["scratch"])
    sys.path[:] = [setup["work"], *sys.path[1:-1], site, *setup["installed"]]
    try:
        facts = confine({**setup, **ours})
    except OSError as error:
        sys.exit(str(error))
    link.frame_bytes = setup["frame_bytes"]
    link.send(Kind.VALUE, sequence, encode(facts))
    Server(link).run()
