"""Records of runs that somebody else offers: nothing of them runs, all are read."""

from __future__ import annotations

import json
import os
from pathlib import Path

from offered_maps import link, pipe, text
from offers import Maker, Offer

import tdac_agent

DEMO = Path(tdac_agent.__file__).parent / "runs" / "demo"


def run(**changes: object) -> Maker:
    """A `run.json` with some fields written otherwise."""

    def make(here: Path) -> None:
        content = json.loads((DEMO / "run.json").read_text())
        (here / "run.json").write_text(json.dumps(content | changes))

    return make


def beside(name: str, make: Maker) -> Maker:
    """A whole `run.json`, and another file."""

    def both(here: Path) -> None:
        run()(here)
        make(here)

    return both


def _offer(name: str, make: Maker, says: str, endless: bool = False) -> Offer:
    return Offer("records", name, ("rules", "."), make, says, endless=endless)


def _replay(name: str, make: Maker, says: str, endless: bool = False) -> Offer:
    words = ("synth", "--learner", "replay:.", "--dry-run")
    return Offer("records", name, words, make, says, endless=endless)


def _large(here: Path) -> None:
    (here / "journal.jsonl").touch()
    os.truncate(here / "journal.jsonl", 10**12)


OFFERS = [
    _offer("endless", link("run.json", "/dev/zero"), "not a regular file", True),
    _offer("pipe", pipe("run.json"), "not a regular file", True),
    _offer("deep", text("run.json", "[" * 100_000), "nested deeper"),
    _offer("digits", text("run.json", "9" * 5000), "limit"),
    _offer("nan", run(seconds=float("nan")), "not a finite number"),
    _offer("surrogate", run(task="\ud800"), "surrogate"),
    _offer("list", text("run.json", "[]"), "not a mapping"),
    _offer("status", run(status="fine"), "status"),
    _offer("enough_flag", run(enough="--max-cost 1 --tier rlimits"), "enough"),
    _offer("enough_shell", run(enough="; touch came #"), "enough"),
    _offer("enough_tier", run(enough={"tier": "rlimits"}), "enough"),
    _offer("enough_both", run(enough={"max_cost": 1, "max_tokens": 1}), "enough"),
    _offer("enough_much", run(enough={"max_cost": 1e300}), "enough"),
    _offer("enough_less", run(enough={"max_tokens": -1}), "enough"),
    _offer("limit", run(max_cost=-1), "max_cost"),
    _offer("counts", run(iterations=2**70), "more than 64 bits"),
    _offer("rules_pipe", beside("", pipe("rules.json")), "not a regular file", True),
    _offer("rules_deep", beside("", text("rules.json", "[" * 9999)), "nested deeper"),
    _replay("journal_pipe", beside("", pipe("journal.jsonl")), "not a regular", True),
    _replay("journal_large", beside("", _large), "larger than 256 MB"),
]
