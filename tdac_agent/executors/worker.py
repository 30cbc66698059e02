"""A worker process: executes one job after another.

    python -m tdac_agent.executors.worker PARENT MODULE TERMS

Reads one job per line, as JSON. Writes lines of JSON: records that the job reports,
then its outcome, or the reason why the worker dies. One judge serves all jobs. The
process is bound to a core, and ends with its parent.
"""

from __future__ import annotations

import json
import os
import sys
from importlib import import_module
from typing import Any, BinaryIO

from tdac_agent.executors.cores import own_core
from tdac_agent.verification.judge.warm import WarmJudge
from tdac_agent.verification.judge.worker_pool import end_with_parent


def main(parent: int, module: str, terms: dict[str, Any]) -> None:
    """Executes the jobs that arrive on stdin, until it is closed."""
    end_with_parent()
    if os.getppid() != parent:
        return
    answers = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # keeps prints of libraries out of the answers

    def tell(record: dict[str, Any]) -> None:
        _send(answers, {"record": record})

    try:
        perform_job = import_module(module).perform_job
        with own_core() as turn, WarmJudge(turn=turn) as judge:
            for line in iter(sys.stdin.readline, ""):
                _send(answers, {"outcome": perform_job(line, terms, judge, tell)})
    except Exception as error:
        reason = " ".join(str(error).split())
        _send(answers, {"death": f"{type(error).__name__}: {reason}"})
        raise


def _send(answers: BinaryIO, message: dict[str, Any]) -> None:
    answers.write(json.dumps(message).encode() + b"\n")
    answers.flush()


if __name__ == "__main__":
    try:
        main(int(sys.argv[1]), sys.argv[2], json.loads(sys.argv[3]))
    except KeyboardInterrupt:
        sys.exit(130)
