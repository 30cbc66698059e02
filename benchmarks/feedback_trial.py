"""What feedback is worth: the runs of results/feedback, as its PLAN.md describes them.

    python -m benchmarks.feedback_trial plan
    python -m benchmarks.feedback_trial run OUT --questions DIR [NAME …] [--jobs 2]

`plan` prints the cells: a run each, with its level, seed, arm and omitted facts. `run`
performs cells in their order, with `tdac synth --learner manual:DIR/GROUP`: a question
is written to a file, and the run waits for the file with the answer. Cells of a group
share its folder, so that equal questions have the same answer: all arms of a group have
the same first answers. After an interruption, the same command continues.
"""

from __future__ import annotations

import argparse
import csv
import json
import sys
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from subprocess import run as run_process
from typing import Any

import numpy as np

from tdac_agent import synthesize
from tdac_agent.prompting.given_rules import given_book, read_given
from tdac_agent.runs.run_record import load_rules, load_run
from tdac_envs.ladder.task_sets import load_set

SEED = 20261129
"""Seed of all draws of the plan."""
FACTS = (
    *("turning", "axes", "units", "radius", "speed", "axle", "rays", "range"),
    *("tolerance", "disturbances", "budget", "worlds"),
)
DOSES = {"unknown": (3, 6, 9, 12, 9, 12), "floor": (3, 6, 9, 12, 6, 12)}
"""Number of omitted facts in each run of the dose experiment."""
ARMS = {"A": "fresh", "E": "repair", "I": "informed", "S": "rules"}
FIRST, ROUNDS = 2, 4
DOSE_EPISODES = 256
PAIRS = {"lost": 8, "floor": 8}
CHEAPER = "A+", "best+"
"""Arms with further answers, until they cost as much as the dearest one."""
OUT_WEIGHT = 5
"""How much more an answered character costs than an asked one."""
CALLS, RACE_FIRST, RACE_EPISODES = 8, 4, 512
TRANSFERS = 8
PLACEBO = Path("results/feedback/placebo.md")


@dataclass(frozen=True, slots=True)
class Cell:
    """A run of the plan.

    Attributes:
        name: Its name, and that of its folder.
        group: Cells of a group share their answers.
        level: Its task set.
        arm: Its arm.
        seed: Seed of its worlds of `dev`.
        prompt: Its prompt.
        omit: The facts that it leaves out, separated by commas.
        rules: The cell whose rules it begins with, or `placebo` and that cell.
    """

    name: str
    group: str
    level: str
    arm: str
    seed: int
    prompt: str
    omit: str = ""
    rules: str = ""


def planned() -> list[Cell]:
    """All cells, in the order in which they are performed."""
    random = np.random.default_rng(SEED)
    groups = [*_doses(random), *_pairs(random)]
    random.shuffle(groups)
    cells = [cell for group in groups for cell in group]
    return [*cells, *_transfers(cells, random)]


def _doses(random: np.random.Generator) -> list[list[Cell]]:
    """Dose and response: four arms in each of six runs of two levels."""
    groups = []
    for level, doses in DOSES.items():
        for number, dose in enumerate(doses, 1):
            group = f"dose-{level}-{number}"
            left = sorted(random.choice(len(FACTS), dose, replace=False).tolist())
            omit = ",".join(FACTS[i] for i in left)
            wording = ("facts", "facts-2")[int(random.integers(2))]
            seed = int(random.integers(2**31))
            arms = list(ARMS)
            random.shuffle(arms)
            cells = [
                Cell(f"{group}-{arm}", group, level, arm, seed, wording, omit)
                for arm in arms
            ]
            further = Cell(f"{group}-A+", group, level, "A+", seed, wording, omit)
            # What all facts are worth, for the same worlds.
            ceiling = Cell(f"{group}-C", f"{group}-C", level, "C", seed, wording)
            groups.append([*cells, further, ceiling])
    return groups


def _pairs(random: np.random.Generator) -> list[list[Cell]]:
    """The race against best of N, with the full prompt."""
    groups = []
    for level, count in PAIRS.items():
        for number in range(1, count + 1):
            group, seed = f"race-{level}-{number}", int(random.integers(2**31))
            arms = ["best", "race"]
            random.shuffle(arms)
            groups.append(
                [
                    Cell(f"{group}-{arm}", group, level, arm, seed, "full")
                    for arm in (*arms, "best+")
                ]
            )
    return groups


def _transfers(cells: list[Cell], random: np.random.Generator) -> list[Cell]:
    """Rules of other runs, and a placebo of the same length, with one answer each."""
    ruled = [cell for cell in cells if cell.arm == "S"]
    chosen = sorted(random.choice(len(ruled), TRANSFERS, replace=False).tolist())
    found = []
    for number, index in enumerate(chosen, 1):
        source = ruled[index]
        group, seed = f"rules-{number}", int(random.integers(2**31))
        kinds = ["rules", "placebo"]
        random.shuffle(kinds)
        for kind in kinds:
            given = source.name if kind == "rules" else f"placebo {source.name}"
            facts = (source.level, kind, seed, source.prompt, source.omit, given)
            found.append(Cell(f"{group}-{kind}", group, *facts))
    return found


def options_of(cell: Cell, out: Path) -> dict[str, Any]:
    """The options of `synthesize` for a cell."""
    about: dict[str, Any] = {"prompt": cell.prompt, "omit": cell.omit}
    about |= {"seed": cell.seed, "search": "race"}
    if cell.arm in ARMS:
        sizes = {"candidates": FIRST, "iterations": FIRST + ROUNDS}
        return {**about, **sizes, "ask": ARMS[cell.arm], "episodes": DOSE_EPISODES}
    if cell.arm in CHEAPER:
        # The same answers, and as many more as the dearest arm of the group paid for.
        base = options_of(cell_named(cell.name[:-1]), out)
        count = base["iterations"] + affordable(cell, out)
        sizes = {"iterations": count}
        if cell.arm == "best+":
            sizes["candidates"] = count
        return {**base, **sizes}
    if cell.arm == "C":
        sizes = {"candidates": FIRST, "iterations": FIRST}
        return {**about, **sizes, "episodes": DOSE_EPISODES}
    if cell.arm in {"best", "race"}:
        first = CALLS if cell.arm == "best" else RACE_FIRST
        sizes = {"candidates": first, "iterations": CALLS}
        return {**about, **sizes, "episodes": RACE_EPISODES}
    kind, _, source = cell.rules.rpartition(" ")
    texts = [rule.text for rule in load_rules(out / source).in_force]
    if kind == "placebo":
        texts = placebo_of(sum(map(len, texts)))
    sizes = {"candidates": 1, "iterations": 1, "episodes": DOSE_EPISODES}
    return {**about, **sizes, "rules": given_book([f"[code] {text}" for text in texts])}


def affordable(cell: Cell, out: Path) -> int:
    """How many more answers cost as much as the dearest arm of a group has."""
    arms = [each for each in planned() if each.group == cell.group]
    spent = {
        each.arm: cost_of(out / each.name) for each in arms if each.arm != cell.arm
    }
    own, calls = spent[cell.arm[:-1]], CALLS if cell.arm == "best+" else FIRST + ROUNDS
    return int((max(spent.values()) - own) / (own / calls))


def cell_named(name: str) -> Cell:
    """The cell of a name."""
    return next(each for each in planned() if each.name == name)


def characters(folder: Path) -> tuple[int, int]:
    """Characters of all questions and of all answers of a run."""
    prompts, replies = (
        sum(len(file.read_text(encoding="utf-8")) for file in folder.rglob(pattern))
        for pattern in ("*.prompt*.md", "*.reply*.md")
    )
    return prompts, replies


def cost_of(folder: Path) -> int:
    """Characters asked, and `OUT_WEIGHT` times those answered."""
    asked, answered = characters(folder)
    return asked + OUT_WEIGHT * answered


def placebo_of(length: int) -> list[str]:
    """Rules that say nothing of a robot, with about as many characters."""
    found: list[str] = []
    for rule in read_given(PLACEBO).in_force:
        if sum(map(len, found)) + len(rule.text) / 2 > length:
            break
        found.append(rule.text)
    return found


def perform(cell: Cell, out: Path, questions: Path) -> None:
    """Performs a cell, unless it has ended."""
    folder = out / cell.name
    if (folder / "run.json").is_file() and load_run(folder).finished:
        return
    if cell.arm in CHEAPER and not all(
        (out / each.name / "run.json").is_file() and load_run(out / each.name).finished
        for each in planned()
        if each.group == cell.group and each.arm not in CHEAPER
    ):
        return  # once the others have ended
    asked = questions / cell.group
    asked.mkdir(parents=True, exist_ok=True)
    synthesize(
        load_set(cell.level),
        f"manual:{asked}",
        out=folder,
        max_tokens=100_000_000,
        **options_of(cell, out),
    )


def main() -> None:
    """Prints the plan, or performs it."""
    parser = argparse.ArgumentParser(description=__doc__)
    commands = parser.add_subparsers(dest="command", required=True)
    commands.add_parser("plan")
    for name in ("run", "cell"):
        command = commands.add_parser(name)
        command.add_argument("out", type=Path)
        command.add_argument("names", nargs="*", help="cells or groups; all by default")
        command.add_argument("--questions", type=Path, required=True)
        command.add_argument("--jobs", type=int, default=2)
    options = parser.parse_args()
    cells = planned()
    if options.command == "plan":
        writer = csv.writer(sys.stdout, lineterminator="\n")
        writer.writerow(field.name for field in fields(Cell))
        writer.writerows(asdict(cell).values() for cell in cells)
        return
    wanted = set(options.names)
    chosen = [c for c in cells if not wanted or {c.name, c.group} & wanted]
    if options.command == "cell":
        for cell in chosen:
            perform(cell, options.out, options.questions)
        return

    def start(cell: Cell) -> None:
        words = [sys.executable, "-m", "benchmarks.feedback_trial", "cell"]
        words += [str(options.out), cell.name, "--questions", str(options.questions)]
        code = run_process(words, check=False).returncode
        print(json.dumps({"cell": cell.name, "exit": code}), flush=True)

    with ThreadPoolExecutor(options.jobs) as pool:
        list(pool.map(start, chosen))


if __name__ == "__main__":
    main()
