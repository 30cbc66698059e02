"""The folder that keeps finished episodes until an evaluation writes its results."""

from __future__ import annotations

import json
import shutil
import tempfile
from collections.abc import Generator
from contextlib import ExitStack, contextmanager
from dataclasses import asdict
from pathlib import Path

from tdac_agent.storage.files import clear_unfinished
from tdac_agent.storage.hashes import sha256_of
from tdac_agent.storage.locks import LOCK_FILE, own_folder
from tdac_agent.tasks.provenance import versions
from tdac_agent.tasks.task import Task
from tdac_agent.verification.judge.kept_episodes import SUFFIX
from tdac_agent.verification.judge.seeded import SeededJob

FOLDER = "unfinished"


@contextmanager
def open_store(out: Path | None, *names: str) -> Generator[Path]:
    """Opens the folder of finished episodes; removes it if the block succeeds.

    An interrupted evaluation leaves the folder in `out`; without `out` it is temporary.

    Args:
        out: The folder of the evaluation.
        names: What else is written in it, see `refuse_links`.

    Raises:
        RunError: The folder cannot be written, another evaluation writes to it, or a
            link leads out of it.
    """
    with ExitStack() as stack:
        if out is None:
            folder = tempfile.TemporaryDirectory(prefix="tdac-evaluate-")
            yield Path(stack.enter_context(folder))
            return
        store = out.absolute() / FOLDER
        lock = f"{FOLDER}/{LOCK_FILE}"
        stack.enter_context(own_folder(out, *names, who="evaluation", lock=lock))
        clear_unfinished(store)
        yield store
        shutil.rmtree(store)


def count_kept(out: Path) -> int:
    """Number of finished episodes that an interrupted evaluation left in `out`."""
    return sum(1 for _ in (out / FOLDER).glob(f"*/*{SUFFIX}"))


def folder_of(store: Path, task: Task, job: SeededJob, sha256: str | None) -> Path:
    """The folder of a policy's episodes on a task; created if it is missing.

    Its name depends on everything that determines an episode, except its seed.

    Args:
        store: See `open_store`.
        task: The task.
        job: The job with the policy.
        sha256: Hash of the policy's file, if any.
    """
    facts = {
        "task": [task.sha256(), task.setting.world_sha256()],
        "policy": [job.policy.kind, job.policy.wrappers, sha256],
        "variation": job.variation,
        "sandbox": [job.tier, asdict(job.limits)],
        "versions": versions(),
    }
    folder = store / sha256_of(json.dumps(facts, sort_keys=True).encode())[:16]
    folder.mkdir(exist_ok=True)
    return folder
