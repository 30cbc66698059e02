"""Kills processes of a campaign with -9, at moments of its own choice."""

import os
import random
import signal
import subprocess
from pathlib import Path

from few_runs import Small


def children(pid):
    """Processes that a process has started and that are there."""
    try:
        text = Path(f"/proc/{pid}/task/{pid}/children").read_text()
    except OSError:
        return []
    return [int(word) for word in text.split()]


def ray_workers(pid):
    """Of the processes below a process, those in which Ray makes a run."""
    found, below = [], children(pid)
    while below:
        one = below.pop()
        below += children(one)
        try:
            words = Path(f"/proc/{one}/cmdline").read_bytes()
        except OSError:
            continue
        if words.startswith(b"ray::_in_task"):
            found.append(one)
    return found


def has_ended(process, seconds):
    """Whether a process ends within some seconds."""
    try:
        process.wait(seconds)
    except subprocess.TimeoutExpired:
        return False
    return True


def check_same_in_the_end(
    folder,
    runs,
    kills,
    seconds,
    workers_of=children,
    flags=(),
    seed=0,
    small_of=Small,
):
    """Kills again and again; then the campaign ends as one that nobody disturbed.

    Args:
        folder: An empty one.
        runs: R.
        kills: How often; a worker and a driver by turns.
        seconds: Within which a process is killed.
        workers_of: Gives the workers of a driver.
        flags: Of the command.
        seed: Of the moments.
        small_of: Makes the campaign of a folder.
    """
    small = small_of(folder)
    small.write(runs=runs, seed=11)
    assert small.run(out="undisturbed")[0] == 0
    chance = random.Random(seed)
    for number in range(kills):
        with small.start(*flags, out="killed") as process:
            if not has_ended(process, chance.uniform(0.0, seconds)):
                victims = workers_of(process.pid) if number % 2 == 0 else []
                os.kill(chance.choice([*victims] or [process.pid]), signal.SIGKILL)
                # A driver whose worker died goes on for a while.
                if victims and not has_ended(process, chance.uniform(0.0, seconds)):
                    process.kill()
            process.communicate()
    code, said, complained = small.run(*flags, out="killed")
    assert (code, complained) == (0, ""), said
    assert small.table("killed") == small.table("undisturbed")
