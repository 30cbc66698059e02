"""`tdac bench`: who is better where, on the same unseen worlds."""

from __future__ import annotations

import contextlib
import os
import shlex
import sys
from collections.abc import Sequence
from pathlib import Path

from rich.markup import escape

from tdac_agent.bench.bench import (
    RESULTS,
    SALT,
    TIMING,
    WORLD_TABLE,
    bench,
    read_worlds,
)
from tdac_agent.bench.entrants import Named, named
from tdac_agent.bench.page import PAGE
from tdac_agent.bench.record import Bench
from tdac_agent.bench.shown import merged, read, write_merged
from tdac_agent.bench.shown import reveal as reveal_folder
from tdac_agent.cli.bench_view import show
from tdac_agent.cli.console import Console
from tdac_agent.cli.flags import check_tier
from tdac_agent.cli.policy_bar import policy_bar
from tdac_agent.cli.sentences import print_sentences
from tdac_agent.errors import RunError
from tdac_agent.executors.local import executor_of
from tdac_agent.library.listing import next_folder
from tdac_agent.verification.judge.child_pool import ChildPool
from tdac_agent.verification.judge.warm import WarmJudge
from tdac_envs.core.errors import TaskError


def run(
    entrants: list[str],
    sets: str,
    split: str,
    worlds: int,
    out: Path | None,
    salt_file: Path | None,
    tier: str,
    executor: str | None,
    workers: int | None,
    as_json: bool,
) -> int:
    """Drives the entrants and prints the results; returns the exit code."""
    check_tier(tier)
    if workers is not None and executor is None:
        raise TaskError("--workers needs --executor local or --executor ray")
    folder, before = out or next_folder("bench"), None
    console, progress = Console(stderr=as_json), Console(stderr=True)
    bar = policy_bar(progress)
    row = bar.add_task("", total=worlds, successes=0, doing="preparing")

    def watch(name: str, entrant: str, episodes: int, successes: int) -> None:
        doing = escape(f"{name}: {entrant}")
        bar.update(
            row, completed=episodes, successes=successes, doing=doing, refresh=True
        )
        if episodes == worlds and not progress.is_terminal:
            line = f"{doing}, {successes} of {worlds} reached"
            progress.print(line, highlight=False, soft_wrap=True)

    with contextlib.suppress(RunError):  # none yet, or not readable
        before = read(folder)
    names = [name for name in sets.split(",") if name]
    try:
        with ChildPool() as child_pool, WarmJudge(child_pool) as judge, bar:
            found = bench(
                entrants,
                names,
                split,
                worlds,
                out=folder,
                salt_file=salt_file,
                tier=tier,
                judge=judge,
                watch=watch,
                executor=None if executor is None else executor_of(executor),
                workers=workers or len(os.sched_getaffinity(0)),
            )
    except KeyboardInterrupt:
        text = f"the episodes so far are in {folder}; to go on, give the same command"
        if out is None:
            text += f" with {shlex.join(['--out', str(folder)])}"
        progress.print(escape(text), soft_wrap=True)
        raise
    if as_json:
        sys.stdout.write(found.model_dump_json(indent=2) + "\n")
    else:
        show(found, console)
        _say_where(folder, salt_file, console)
        _say_replaced(before, found, folder, console)
        _say_how_to_watch(found, named(entrants), names, folder, console)
    return 0 if any(each.time for each in found.rows) else 1


def _say_where(folder: Path, salt_file: Path | None, console: Console) -> None:
    """Prints which files there are, and how to reveal sealed worlds."""
    files = RESULTS, WORLD_TABLE, TIMING, SALT
    names = [name for name in files if (folder / name).exists()]
    names += sorted(path.name for path in folder.glob("*.svg"))
    names += [PAGE] if (folder / PAGE).exists() else []
    console.print(escape(f"wrote {', '.join(names)} to {folder}"), soft_wrap=True)
    if salt_file is not None and not (folder / SALT).exists():
        words = ["tdac", "bench", "reveal", str(folder), "--salt-file", str(salt_file)]
        line = f"the worlds are sealed until [bold]{escape(shlex.join(words))}[/]"
        console.print(line, soft_wrap=True, highlight=False)


def _say_replaced(
    before: Bench | None, found: Bench, folder: Path, console: Console
) -> None:
    """Prints which earlier results of the folder are not among the new ones."""
    if before is None:
        return
    others = [own for own in before.sets if own not in found.sets]
    for own in others:
        worlds = "world" if own.worlds == 1 else "worlds"
        text = f"{own.worlds} {worlds} of {own.split} of {own.name} {own.sha256[:8]}"
        print_sentences(console, f"These results replace those on {text}.")
    there = {row.entrant for row in found.rows}
    gone = [name for name in before.entrants if name not in there]
    if gone and not others:
        print_sentences(
            console,
            f"These results replace those of {', '.join(gone)}. What they did is kept "
            f"in {folder}: name them as well, and nothing is driven again.",
        )


def _say_how_to_watch(
    found: Bench,
    entrants: Sequence[Named],
    names: Sequence[str],
    folder: Path,
    console: Console,
) -> None:
    """Prints how to see the first failure of the user's first controller."""
    own = [e for e in entrants if len(e.words) == 1 and e.words[0].endswith(".py")]
    rows = folder / WORLD_TABLE
    if not own or not rows.is_file() or not any(row.time for row in found.rows):
        return
    entrant, table = own[0], read_worlds(rows)
    for name, tasks in zip(names, found.sets, strict=True):
        mine = table[(table["set"] == tasks.name) & (table["entrant"] == entrant.name)]
        failed = mine[mine["success"] == 0]["index"]
        if failed.size and tasks.split != "hidden":
            play = ["tdac", "play", entrant.words[0], "--set", name]
            play += ["--split", tasks.split, "--index", str(failed.iloc[0])]
            line = f"watch the first failure: [bold]{escape(shlex.join(play))}[/]"
            console.print(line, soft_wrap=True, highlight=False)
            return


def show_folders(folders: Sequence[Path], out: Path | None, as_json: bool) -> int:
    """Prints results again, and writes those of several folders together; returns 0."""
    found = merged(folders) if out is None else write_merged(folders, out)
    if as_json:
        sys.stdout.write(found.model_dump_json(indent=2) + "\n")
    else:
        console = Console()
        show(found, console)
        if out is not None:
            _say_where(out, None, console)
    return 0


def reveal(folder: Path, salt_file: Path) -> int:
    """Publishes the hidden worlds of a bench; returns 0."""
    reveal_folder(folder, salt_file)
    text = f"wrote {WORLD_TABLE}, {SALT} to {folder}: its worlds are public now"
    Console().print(escape(text), soft_wrap=True)
    return 0
