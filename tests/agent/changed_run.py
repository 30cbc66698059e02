"""Run folders: what their journals tell, and records that say something else."""

import json
from pathlib import Path

from tdac_agent.runs.run_record import Run, load_run


def journal(folder: Path, event: str | None = None) -> list[dict]:
    """The records of a run, or those of one kind of event."""
    lines = (folder / "journal.jsonl").read_text().splitlines()
    records = [json.loads(line) for line in lines]
    return [each for each in records if event in (None, each["event"])]


def change_run(folder: Path, **values: object) -> Run:
    """Changes values of a run's record; returns the changed one."""
    run = load_run(folder).model_copy(update=values)
    (folder / "run.json").write_text(run.model_dump_json())
    return run
