"""A process that makes one run after the other.

    python -m tdac_agent.campaign.worker PARENT TERMS

Reads a planned run per line, as JSON, and writes records of its journal and in the end
its outcome, or what it died of. It has a judge for all of them, a core of its own, and
one thread for whatever libraries compute with; it ends with the one that started it.
"""

from __future__ import annotations

import json
import os
import sys
from typing import Any, BinaryIO

from tdac_agent.campaign.cores import own_core
from tdac_agent.campaign.perform import Terms, perform
from tdac_agent.campaign.plan import PlannedRun
from tdac_agent.verification.judge.warm import WarmJudge
from tdac_agent.verification.judge.workers import end_with_parent

TOLD = frozenset({"call.intent", "call.fault", "verify.start"})
FACTS = ("event", "kind", "k", "j", "fault")


def main(parent: int, terms: Terms) -> None:
    """Does what is asked for until nothing more is."""
    end_with_parent()
    if os.getppid() != parent:
        return
    answers = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # what others print is no answer
    try:
        with own_core() as turn, WarmJudge(turn=turn) as judge:
            for line in iter(sys.stdin.readline, ""):
                planned = PlannedRun.from_json(line)
                outcome = perform(planned, terms, judge, lambda r: _tell(answers, r))
                _say(answers, {"outcome": outcome.to_json()})
    except Exception as error:
        reason = " ".join(str(error).split())
        _say(answers, {"death": f"{type(error).__name__}: {reason}"})
        raise


def _tell(answers: BinaryIO, record: dict[str, Any]) -> None:
    if record.get("event") in TOLD:
        facts = {name: record[name] for name in FACTS if name in record}
        _say(answers, {"record": facts})


def _say(answers: BinaryIO, message: dict[str, Any]) -> None:
    answers.write(json.dumps(message).encode() + b"\n")
    answers.flush()


if __name__ == "__main__":
    try:
        main(int(sys.argv[1]), Terms(**json.loads(sys.argv[2])))
    except KeyboardInterrupt:
        sys.exit(130)
