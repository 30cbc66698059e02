"""A worker process of a campaign: executes one run after another.

    python -m tdac_agent.campaign.worker PARENT TERMS

Reads one planned run per line, as JSON. Writes lines of JSON: journal records of the
run, then its outcome, or the reason why the worker dies. One judge serves all runs. The
process is bound to a core, and ends with its parent.
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
from tdac_agent.verification.judge.worker_pool import end_with_parent

REPORTED_EVENTS = frozenset({"call.intent", "call.fault", "verify.start"})
REPORTED_KEYS = ("event", "kind", "k", "j", "fault")


def main(parent: int, terms: Terms) -> None:
    """Executes the runs that arrive on stdin, until it is closed."""
    end_with_parent()
    if os.getppid() != parent:
        return
    answers = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # keeps prints of libraries out of the answers
    try:
        with own_core() as turn, WarmJudge(turn=turn) as judge:
            for line in iter(sys.stdin.readline, ""):
                planned = PlannedRun.from_json(line)
                outcome = perform(planned, terms, judge, lambda r: _report(answers, r))
                _send(answers, {"outcome": outcome.to_json()})
    except Exception as error:
        reason = " ".join(str(error).split())
        _send(answers, {"death": f"{type(error).__name__}: {reason}"})
        raise


def _report(answers: BinaryIO, record: dict[str, Any]) -> None:
    if record.get("event") in REPORTED_EVENTS:
        facts = {name: record[name] for name in REPORTED_KEYS if name in record}
        _send(answers, {"record": facts})


def _send(answers: BinaryIO, message: dict[str, Any]) -> None:
    answers.write(json.dumps(message).encode() + b"\n")
    answers.flush()


if __name__ == "__main__":
    try:
        main(int(sys.argv[1]), Terms(**json.loads(sys.argv[2])))
    except KeyboardInterrupt:
        sys.exit(130)
