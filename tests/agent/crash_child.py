"""Runs beside each other in a process that is killed with -9 in a journal's write.

    python crash_child.py TASK URL KILL_AT SHARE MAX_COST K FOLDER...

Of the KILL_AT-th line that it appends to journals (0: of none) only a SHARE is written.
Prints the status of each run. The runs share a budget in a file beside them.
"""

import itertools
import os
import signal
import sys
import threading
from pathlib import Path

from unconfirmed import synthesize

from tdac_agent import load_task
from tdac_agent.models.budget import Budget
from tdac_agent.models.openai_api import OpenAIModel
from tdac_agent.models.retry import RetryPolicy
from tdac_agent.runs.run_record import JOURNAL


def killing_write(write, kill_at, share):
    """What `os.write` does, until the process is killed in it."""
    lock, lines = threading.Lock(), itertools.count(1)

    def wrapped(handle, data):
        if os.readlink(f"/proc/self/fd/{handle}").endswith(JOURNAL):
            with lock:
                if next(lines) == kill_at:
                    write(handle, data[: int(share * len(data))])
                    os.kill(os.getpid(), signal.SIGKILL)
        return write(handle, data)

    return wrapped


def run_all(task, url, max_cost, folders, iterations):
    """The statuses of the runs; their server is the vendor's, with known prices."""
    ledger = Path(folders[0]).parent / "ledger.jsonl"
    budget, ended = Budget(max_cost, ledger=ledger), {}

    def run(index, folder):
        model = OpenAIModel("gpt-4o", url.replace("RUN", f"run{index}"))
        model.served_at = None
        ended[index] = synthesize(
            load_task(task),
            model,
            out=Path(folder),
            iterations=iterations,
            patience=0,
            max_output=1000,
            budget=budget,
            index=index,
            retry=RetryPolicy(first_wait=0.0),
        ).status

    threads = [threading.Thread(target=run, args=pair) for pair in enumerate(folders)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    return [ended.get(index) for index in range(len(folders))]


if __name__ == "__main__":
    task, url, kill_at, share, max_cost, iterations, *folders = sys.argv[1:]
    os.write = killing_write(os.write, int(kill_at), float(share))
    print(*run_all(task, url, float(max_cost), folders, int(iterations)))
