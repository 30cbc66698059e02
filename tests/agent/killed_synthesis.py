"""Starts `tdac synth` in processes of their own, and kills them with -9."""

import os
import random
import signal
import subprocess
import sys


def start(folder, words, out):
    """`tdac synth` with some words and a run folder, in a process group of its own."""
    return subprocess.Popen(
        [sys.executable, "-m", "tdac_agent", "synth", *words, "--out", out],
        cwd=folder,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        start_new_session=True,
    )


def finish(folder, words, out):
    """Runs it to its end, which is a success."""
    with start(folder, words, out) as process:
        said, _ = process.communicate()
    assert process.returncode == 0, said


def kill_again_and_again(folder, words, out, times, most_seconds):
    """Begins and resumes it some times; returns how often it was killed.

    Later kills hit later steps, since what is on record is not repeated.
    """
    chance, killed = random.Random(4), 0
    for _ in range(times):
        with start(folder, words, out) as process:
            try:
                process.communicate(timeout=chance.uniform(1.0, most_seconds))
            except subprocess.TimeoutExpired:
                os.killpg(process.pid, signal.SIGKILL)
                process.communicate()
                killed += 1
    return killed
