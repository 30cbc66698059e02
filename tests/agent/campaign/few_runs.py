"""A campaign that needs little time, and how it is run."""

import os
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import pandas as pd
import yaml
from script import STILL
from small import write_small_task

CLOCK = ["seconds"]


@dataclass(frozen=True)
class Small:
    """A campaign on the small task, as a user has it: a file and a command."""

    folder: Path

    def write(self, name="few", **changes):
        """Writes its file; `scripted` is right in half of its answers."""
        write_small_task(self.folder / "small", profile="policy")
        (self.folder / "still.py").write_text(STILL)
        either = [{"weight": 1}, {"weight": 1, "file": "still.py"}]
        script = {"schema": 1, "generate": either, "edit": either}
        (self.folder / "half.yaml").write_text(yaml.safe_dump(script))
        content = {
            "schema": 1,
            "name": "few",
            "tasks": ["small"],
            "learners": ["builtin", f"scripted:{self.folder / 'half.yaml'}"],
            "runs": 2,
            "iterations": 3,
        }
        (self.folder / f"{name}.yaml").write_text(yaml.safe_dump(content | changes))

    def start(self, *flags, name="few", out="out"):
        """The command, in a process of its own."""
        words = [f"{name}.yaml", "--out", out, *map(str, flags)]
        return subprocess.Popen(
            [sys.executable, "-m", "tdac_agent", "campaign", *words],
            cwd=self.folder,
            env=os.environ | {"COLUMNS": "200"},
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )

    def run(self, *flags, name="few", out="out"):
        """The command to its end; gives exit code, stdout and stderr."""
        with self.start(*flags, name=name, out=out) as process:
            said, complained = process.communicate()
        return process.returncode, said, complained

    def table(self, out="out"):
        """What came of all runs, without what the clock has a say in."""
        runs = pd.read_csv(self.folder / out / "runs.csv").drop(columns=CLOCK)
        tried = pd.read_csv(self.folder / out / "candidates.csv")
        return runs.to_csv(), tried.to_csv()
