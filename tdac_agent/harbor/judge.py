"""What `tests/test.sh` of a Harbor task runs: judges the controller of an agent.

    python -m tdac_agent.harbor.judge CONTROLLER TESTS LOGS

Writes `reward.json` and `report.json` to LOGS. A fault of the judge writes no reward,
which Harbor counts as an error of the trial, neither as a success nor as a failure.
"""

from __future__ import annotations

import json
import stat
import sys
from pathlib import Path

from tdac_agent.errors import Fault
from tdac_agent.problems.choice import problem_of
from tdac_agent.runs.ownership import load_task
from tdac_agent.storage.files import write_atomic
from tdac_agent.synthesis.answers import Exam
from tdac_agent.tasks.task_file import SET_FILE, TASK_FILE
from tdac_envs.core.errors import TdacError
from tdac_envs.core.intake import TEXT_BYTES, parse_json, read_file
from tdac_envs.ladder.task_sets import load_set

WORLDS_FILE = "worlds.json"
"""How many worlds of a task set are driven on."""
SALT_FILE = "salt"
TASK_FOLDER = "task"
MOST_BYTES = 1_000_000
"""Larger files are not read; the tests refuse much smaller ones."""


def exam_in(tests: Path) -> Exam:
    """The problem, and how it is judged, in the folder `tests` of a Harbor task.

    Raises:
        TdacError: It cannot be read.
    """
    if (tests / TASK_FOLDER / TASK_FILE).is_file():
        return Exam(problem_of(load_task(tests / TASK_FOLDER)))
    worlds = parse_json(read_file(tests / WORLDS_FILE, TEXT_BYTES))
    tasks = load_set(tests / SET_FILE)
    return Exam(problem_of(tasks), worlds, "hidden", tests / SALT_FILE)


def main(words: list[str]) -> int:
    """Judges, and prints the feedback; returns the exit code."""
    controller, tests, logs = map(Path, words)
    try:
        exam = exam_in(tests)
        source, fault = _read(controller)
        judged = None if source is None else exam.judge(source, lambda: None)
    except (TdacError, Fault, OSError, ValueError) as error:
        print(f"no verdict: {error}", file=sys.stderr)
        return 3
    scores = dict.fromkeys(exam.scores, 0.0) if judged is None else judged.scores
    if judged is not None:
        _write(logs / "report.json", judged.facts["report"])
    _write(logs / "reward.json", {"reward": scores[exam.scores[0]], **scores})
    print(fault if judged is None else judged.feedback)
    return 0


def _read(path: Path) -> tuple[bytes | None, str]:
    """The controller; if there is none, the reason."""
    try:
        status = path.lstat()
    except OSError:
        return None, f"there is no {path.name}"
    # A link could name a file that only the judge may read.
    if not stat.S_ISREG(status.st_mode):
        return None, f"{path.name} is not an ordinary file"
    if status.st_size > MOST_BYTES:
        return None, f"{path.name} is larger than {MOST_BYTES} bytes"
    return read_file(path, MOST_BYTES), ""


def _write(path: Path, values: object) -> None:
    write_atomic(path, json.dumps(values, indent=2) + "\n")


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
