"""What `falsify.json` of a run says, for its report."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

from tdac_agent.html_report.scene import data_address
from tdac_agent.runs.falsification import (
    PICTURE,
    RECORD_FILE,
    Envelope,
    Falsification,
    load_falsification,
)
from tdac_agent.runs.falsify_text import (
    NO_PROOF,
    failure_text,
    plain_text,
    rows_of,
    summary_of,
)
from tdac_agent.storage.files import read_inside
from tdac_agent.storage.hashes import sha256_of
from tdac_envs.core.intake import TEXT_BYTES

_MOST_BYTES = 16 << 20


def envelope_of(folder: Path) -> dict[str, Any] | None:
    """Values for the template; None if the run has no record of this search.

    Of a record that says nothing of the run's controller, only why it does not.
    """
    if not os.path.lexists(folder / RECORD_FILE):
        return None
    try:
        found = load_falsification(folder)
    except (OSError, ValueError):
        return {"left_out": f"{RECORD_FILE} cannot be read, or is damaged"}
    if found.policy_sha256 != _controller_sha256(folder):
        return {"left_out": f"{RECORD_FILE} is of another controller"}
    failed, summary = found.counterexample, summary_of(found)
    return {
        "left_out": "",
        "summary": summary[:1].upper() + summary[1:],
        "failure": "" if failed is None else failure_text(failed, found),
        "worlds": [_world(each, found) for each in found.envelopes],
        "is_set": found.split is not None,
        "note": NO_PROOF.format(found.episodes),
        "sizes": {p: found.value(p, s).lstrip("+") for p, s in found.space.items()},
        "picture": _picture(folder),
    }


def _world(envelope: Envelope, found: Falsification) -> dict[str, Any]:
    plain = plain_text(envelope, found)
    return {"number": envelope.number, "plain": plain, "rows": rows_of(envelope, found)}


def _controller_sha256(folder: Path) -> str:
    """Hash of the run's controller: a search for another one says nothing of it."""
    try:
        return sha256_of(read_inside(folder, "controller.py", TEXT_BYTES))
    except (OSError, ValueError):
        return ""


def _picture(folder: Path) -> str | None:
    """The picture of the counterexample as a data URL; None if there is none."""
    try:
        picture = read_inside(folder, PICTURE, _MOST_BYTES)
    except (OSError, ValueError):
        return None
    return data_address(picture, "image/png")
