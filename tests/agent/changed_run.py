"""A run folder whose record says something else."""

from pathlib import Path

from tdac_agent.runs.run_record import Run, load_run


def change_run(folder: Path, **values: object) -> Run:
    """Changes values of a run's record; returns the changed one."""
    run = load_run(folder).model_copy(update=values)
    (folder / "run.json").write_text(run.model_dump_json())
    return run
