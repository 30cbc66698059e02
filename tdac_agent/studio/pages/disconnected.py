"""What a page says when its server is gone, and how it goes on with the next one."""

from __future__ import annotations

import json
import secrets
import shlex
from pathlib import Path

import fastapi
from fastapi import Response
from nicegui import ui

ALIVE = "/alive"
INSTANCE = secrets.token_hex(8)
"""Tells this server from the next one on the same port."""
ENDED = (
    "The studio has ended, or cannot be reached. Start it again with `tdac studio`, "
    "and this page continues. Its folder: {}"
)
FOREIGN = (
    "A server that does not know this page answers here. If it is a studio, open the "
    "address that it printed."
)
SCRIPT = """<div id="lost" role="alert" hidden></div>
<script>
(() => {
  const texts = %s;
  const box = document.getElementById("lost");
  const show = (text) => {
    if (box.textContent !== text) box.textContent = text;
    box.hidden = !text;
  };
  const look = async () => {
    let lost = true;
    try {
      const answer = await fetch(texts.alive, { signal: AbortSignal.timeout(5000) });
      if (!answer.ok) show(texts.foreign);
      else if ((await answer.text()) !== texts.instance) return location.reload();
      else { show(""); lost = false; }
    } catch { show(texts.ended); }
    setTimeout(look, lost ? 1000 : 3000);
  };
  setTimeout(look, 3000);
})();
</script>"""


def add(application: fastapi.FastAPI, place: Path) -> None:
    """Lets all pages say when their server is gone, and load themselves from the next.

    Args:
        application: Gets an address by which pages know that the server is there.
        place: Folder of the studio.
    """
    texts = {
        "alive": ALIVE,
        "instance": INSTANCE,
        "ended": ENDED.format(shlex.quote(str(place))),
        "foreign": FOREIGN,
    }
    script = SCRIPT % json.dumps(texts).replace("<", "\\u003c")
    ui.add_body_html(script, shared=True)

    @application.get(ALIVE)
    def alive() -> Response:
        return Response(INSTANCE, media_type="text/plain")
