"""The learning curve of a training: a row for each evaluation."""

from __future__ import annotations

import csv
import io
from dataclasses import asdict, dataclass, fields
from pathlib import Path

from tdac_agent.errors import RunError
from tdac_agent.storage.csv_file import read_rows
from tdac_agent.storage.files import write_atomic
from tdac_envs.core.errors import one_line_reason

CURVE_FILE = "learning_curve.csv"
PLAN_FILE = "training.json"


@dataclass(frozen=True, slots=True)
class Point:
    """An evaluation with deterministic actions, and the success rate in training.

    Attributes:
        steps: Training steps so far, all robots together.
        seconds: Wall time so far, evaluations included.
        success_rate: Share of the evaluation's episodes in which the goal was reached.
        collision_rate: Share of episodes with a contact.
        mean_return: Mean return of an episode.
        mean_length: Mean length of an episode, steps.
        train_success_rate: Success rate of the last 100 training episodes, with
            exploration; nan before the first one.
    """

    steps: int
    seconds: float
    success_rate: float
    collision_rate: float
    mean_return: float
    mean_length: float
    train_success_rate: float

    @property
    def worth(self) -> tuple[float, float, float]:
        """Sort key for the best policy: successes, fewer contacts, return."""
        return self.success_rate, -self.collision_rate, self.mean_return


def write_curve(folder: Path, points: list[Point]) -> None:
    """Writes `learning_curve.csv`."""
    text = io.StringIO()
    names = [field.name for field in fields(Point)]
    writer = csv.DictWriter(text, names, lineterminator="\n")
    writer.writeheader()
    writer.writerows(asdict(point) for point in points)
    write_atomic(folder / CURVE_FILE, text.getvalue())


def read_curve(folder: Path) -> list[Point]:
    """The points of a training; none before the first evaluation.

    Raises:
        RunError: The file cannot be read.
    """
    file = folder / CURVE_FILE
    try:
        rows = read_rows(file, [f.name for f in fields(Point)])
        return [
            Point(int(row["steps"]), *(float(row[f.name]) for f in fields(Point)[1:]))
            for row in rows
        ]
    except FileNotFoundError:
        return []
    except (OSError, ValueError) as error:
        raise RunError(f"cannot read {file}: {one_line_reason(error)}") from error
