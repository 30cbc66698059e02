"""`tdac bench`: who is better where, on the same unseen worlds."""

from __future__ import annotations

import contextlib
import os
import shlex
from collections.abc import Sequence
from pathlib import Path

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
from tdac_agent.cli.bench_flags import BenchOptions, RevealOptions, ShowOptions
from tdac_agent.cli.bench_view import show
from tdac_agent.cli.console import Console, print_json
from tdac_agent.cli.driving_bar import DrivingBar
from tdac_agent.cli.sentences import print_command, print_plain, print_sentences
from tdac_agent.cli.task_choice import check_tier
from tdac_agent.errors import RunError
from tdac_agent.executors.local import executor_of
from tdac_agent.library.listing import next_folder
from tdac_agent.verification.judge.child_pool import ChildPool
from tdac_agent.verification.judge.warm import WarmJudge


def run(options: BenchOptions) -> int:
    """Drives the entrants and prints the results; returns the exit code."""
    check_tier(options.tier)
    folder, before = options.out or next_folder("bench"), None
    console, progress = Console(stderr=options.as_json), Console(stderr=True)
    bar = DrivingBar(progress, options.worlds)

    def watch(name: str, entrant: str, episodes: int, successes: int) -> None:
        doing = f"{name}: {entrant}"
        bar.show(episodes, successes, doing)
        if episodes == options.worlds and not progress.is_terminal:
            print_plain(progress, f"{doing}, {successes} of {episodes} reached")

    with contextlib.suppress(RunError):  # none yet, or not readable
        before = read(folder)
    names, tasks = _names(options.sets), _names(options.tasks)
    executor = None if options.executor is None else executor_of(options.executor)
    try:
        with ChildPool() as child_pool, WarmJudge(child_pool) as judge, bar:
            results = bench(
                options.entrants,
                names,
                options.split,
                options.worlds,
                out=folder,
                tasks=tasks,
                salt_file=options.salt_file,
                physics=options.physics,
                tier=options.tier,
                judge=judge,
                watch=watch,
                executor=executor,
                workers=options.workers or len(os.sched_getaffinity(0)),
            )
    except KeyboardInterrupt:
        text = f"the episodes so far are in {folder}; to go on, give the same command"
        if options.out is None:
            text += f" with {shlex.join(['--out', str(folder)])}"
        print_plain(progress, text)
        raise
    if options.as_json:
        print_json(results)
    else:
        show(results, console)
        _print_where(folder, options.salt_file, console)
        _print_replaced(before, results, folder, console)
        _print_how_to_watch(results, named(options.entrants), names, folder, console)
    return 0 if any(each.time for each in results.rows) else 1


def _names(words: str) -> list[str]:
    return [name for name in words.split(",") if name]


def _print_where(folder: Path, salt_file: Path | None, console: Console) -> None:
    """Prints which files there are, and how to reveal sealed worlds."""
    files = RESULTS, WORLD_TABLE, TIMING, SALT
    names = [name for name in files if (folder / name).exists()]
    names += sorted(path.name for path in folder.glob("*.svg"))
    names += [PAGE] if (folder / PAGE).exists() else []
    print_plain(console, f"wrote {', '.join(names)} to {folder}")
    if salt_file is not None and not (folder / SALT).exists():
        words = ["bench", "reveal", str(folder), "--salt-file", str(salt_file)]
        print_command(console, "the worlds are sealed until", words)


def _print_replaced(
    before: Bench | None, results: Bench, folder: Path, console: Console
) -> None:
    """Prints which earlier results of the folder are not among the new ones."""
    if before is None:
        return
    others = [own for own in before.sets if own not in results.sets]
    for own in others:
        worlds = "world" if own.worlds == 1 else "worlds"
        text = f"{own.worlds} {worlds} of {own.split} of {own.name} {own.sha256[:8]}"
        print_sentences(console, f"These results replace those on {text}.")
    there = {row.entrant for row in results.rows}
    gone = [name for name in before.entrants if name not in there]
    if gone and not others:
        print_sentences(
            console,
            f"These results replace those of {', '.join(gone)}. What they did is kept "
            f"in {folder}: name them as well, and nothing is driven again.",
        )


def _print_how_to_watch(
    results: Bench,
    entrants: Sequence[Named],
    names: Sequence[str],
    folder: Path,
    console: Console,
) -> None:
    """Prints how to see the first failure of the user's first controller."""
    own = [e for e in entrants if len(e.words) == 1 and e.words[0].endswith(".py")]
    rows = folder / WORLD_TABLE
    if not own or not rows.is_file() or not any(row.time for row in results.rows):
        return
    entrant, table = own[0], read_worlds(rows)
    for name, tasks in zip(names, results.sets, strict=False):  # tasks come last
        mine = table[(table["set"] == tasks.name) & (table["entrant"] == entrant.name)]
        failed = mine[mine["success"] == 0]["index"]
        if failed.size and tasks.split != "hidden":
            play = ["play", entrant.words[0], "--set", name]
            play += ["--split", tasks.split, "--index", str(failed.iloc[0])]
            print_command(console, "watch the first failure:", play)
            return


def show_folders(options: ShowOptions) -> int:
    """Prints results again, and writes those of several folders together; returns 0."""
    folders, out = options.folders, options.out
    results = merged(folders) if out is None else write_merged(folders, out)
    if options.as_json:
        print_json(results)
        return 0
    console = Console()
    show(results, console)
    if out is not None:
        _print_where(out, None, console)
    return 0


def reveal(options: RevealOptions) -> int:
    """Publishes the hidden worlds of a bench; returns 0."""
    reveal_folder(options.folder, options.salt_file)
    text = f"wrote {WORLD_TABLE}, {SALT} to {options.folder}"
    print_plain(Console(), f"{text}: its worlds are public now")
    return 0
