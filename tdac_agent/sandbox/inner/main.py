"""Entry of the child: read the setup, give up rights, serve."""

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
    """Serve the judge on two descriptors until it closes them.

    Args:
        requests: Descriptor that the judge writes to.
        answers: Descriptor that the judge reads.
        lifeline: Descriptor that has to stay open.
        site: Folder from which numpy is imported.
    """
    link = Link(requests, answers)
    _, sequence, payload = link.receive()
    setup = decode(payload)
    ours = {"descriptors": [requests, answers], "lifeline": lifeline}
    sys.argv = ["controller.py"]
    os.environ.update(HOME=setup["scratch"], TMPDIR=setup["scratch"])
    sys.path[:] = [setup["work"], *sys.path[1:-1], site]
    try:
        facts = confine({**setup, **ours})
    except OSError as error:
        sys.exit(str(error))
    link.frame_bytes = setup["frame_bytes"]
    link.send(Kind.VALUE, sequence, encode(facts))
    Server(link).run()
