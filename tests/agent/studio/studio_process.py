"""A studio in a process of its own."""

import contextlib
import os
import signal
import subprocess
import sys
from dataclasses import dataclass, field
from pathlib import Path

SECONDS = 90


@contextlib.contextmanager
def running_studio(place):
    """A studio that runs in a folder until the end of the block."""
    running = Studio(place)
    running.start()
    try:
        yield running
    finally:
        running.kill()


@dataclass
class Studio:
    """A running studio."""

    place: Path
    port: int = 0
    process: subprocess.Popen = field(init=False)
    address: str = field(init=False)

    def start(self):
        words = [sys.executable, "-m", "tdac_agent", "studio", "--port", str(self.port)]
        self.process = subprocess.Popen(
            words,
            cwd=self.place,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            text=True,
            env={**os.environ, "ANTHROPIC_API_KEY": ""},
        )
        self.address = self.process.stdout.readline().strip()
        assert self.address.startswith("http://127.0.0.1:"), self.address

    @property
    def base(self):
        return self.address.partition("/?")[0]

    def kill(self):
        self.process.send_signal(signal.SIGKILL)
        self.process.wait()
        self.process.stdout.close()
