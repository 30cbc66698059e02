"""What feedback is worth: the runs of results/feedback, as its PLAN.md describes them.

    python -m benchmarks.feedback_trial plan
    python -m benchmarks.feedback_trial questions
    python -m benchmarks.feedback_trial run OUT --questions DIR [GROUP …] [--jobs 2]

`plan` prints the cells: a run each, with its level, seed, arm and omitted facts;
`questions` the hash of the first question of each. `run` performs groups of cells in
their order, with `tdac synth --learner manual:DIR/GROUP`: a question
is written to a file, and the run waits for the file with the answer. Cells of a group
share its folder, so that equal questions have the same answer: all arms of a group have
the same first answers. After an interruption, the same command continues.
"""

from __future__ import annotations

import argparse
import csv
import functools
import itertools
import json
import sys
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from subprocess import run as run_process
from typing import Any

import numpy as np

from tdac_agent import synthesize
from tdac_agent.problems.choice import problem_of
from tdac_agent.prompting.facts import FACTS, WORDINGS, FactsPrompt
from tdac_agent.prompting.given_rules import given_book, read_given
from tdac_agent.prompting.prompt import load_template
from tdac_agent.runs.run_record import load_rules, load_run
from tdac_agent.storage.hashes import sha256_of
from tdac_agent.synthesis.question_kinds import ASKED
from tdac_agent.synthesis.workload import shares
from tdac_envs.ladder.task_sets import load_set

SEED = 20261129
"""Seed of all draws of the plan."""
OMITTED = tuple(fact for fact in FACTS if fact != "score")
"""The facts that a run may leave out: the score is told in all of them."""
DOSES = {"unknown": (3, 6, 9, 12, 9, 12), "floor": (3, 6, 9, 12, 6, 12)}
"""Number of omitted facts in each run of the dose experiment."""
ARMS = {
    "A": "fresh",
    "E": "repair",
    "I": "informed",
    "M": "measured",
    "S": "rules",
}
FIRST, ROUNDS = 2, 4
DOSE_POOL, RACE_POOL = 16, 24
"""Worlds of the pool, the same in all arms however many answers they have."""
PAIRS = {"lost": 8, "floor": 8}
CHEAPER = "A+", "best+"
"""Arms with further answers, until they cost as much as the dearest one."""
OUT_WEIGHT = 5
"""How much more an answered character costs than an asked one."""
CALLS, RACE_FIRST = 8, 4
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


@functools.cache
def planned() -> tuple[Cell, ...]:
    """All cells, in the order in which they are performed."""
    random = np.random.default_rng(SEED)
    groups = [*_doses(random), *_pairs(random)]
    random.shuffle(groups)
    cells = [cell for group in groups for cell in group]
    return (*cells, *_transfers(cells, random))


def _doses(random: np.random.Generator) -> list[list[Cell]]:
    """Dose and response: four arms in each of six runs of two levels."""
    groups = []
    for level, doses in DOSES.items():
        for number, dose in enumerate(doses, 1):
            group = f"dose-{level}-{number}"
            left = sorted(random.choice(len(OMITTED), dose, replace=False).tolist())
            omit = ",".join(OMITTED[i] for i in left)
            wording = list(WORDINGS)[int(random.integers(2))]
            prompt = FactsPrompt(wording, tuple(omit.split(","))).name
            seed = int(random.integers(2**31))
            arms = list(ARMS)
            random.shuffle(arms)
            cells = [
                Cell(f"{group}-{arm}", group, level, arm, seed, prompt, omit)
                for arm in arms
            ]
            further = Cell(f"{group}-A+", group, level, "A+", seed, prompt, omit)
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
    first, answers, ask = _sizes(cell, out)
    pool = RACE_POOL if cell.group.startswith("race") else DOSE_POOL
    about: dict[str, Any] = {
        "prompt": cell.prompt,
        "seed": cell.seed,
        "search": "race",
        "candidates": first,
        "iterations": answers,
        "ask": ask,
        "episodes": episodes_for(pool, answers),
    }
    if not cell.rules:
        return about
    kind, _, source = cell.rules.rpartition(" ")
    texts = [rule.text for rule in load_rules(out / source).in_force]
    if kind == "placebo":
        texts = placebo_of(sum(map(len, texts)))
    return about | {"rules": given_book([f"[code] {text}" for text in texts])}


def _sizes(cell: Cell, out: Path) -> tuple[int, int, str]:
    """First answers, all answers, and kinds of the other questions of a cell."""
    fresh = ARMS["A"]
    if cell.arm in ARMS:
        return FIRST, FIRST + ROUNDS, ARMS[cell.arm]
    if cell.arm == "race":
        return RACE_FIRST, CALLS, ",".join(ASKED)
    if cell.arm == "A+":  # arm A, and as many more as the dearest arm paid for
        return FIRST, FIRST + ROUNDS + affordable(cell, out), fresh
    count = {"C": FIRST, "best": CALLS, "rules": 1, "placebo": 1}.get(cell.arm)
    if count is None:  # best+
        count = CALLS + affordable(cell, out)
    return count, count, fresh


def episodes_for(pool: int, answers: int) -> int:
    """The least episodes of a run whose pool has so many worlds for all answers."""
    sizes = itertools.count(2)
    return next(each for each in sizes if shares(each, 0, answers).block == pool)


def affordable(cell: Cell, out: Path) -> int:
    """How many more answers cost as much as the dearest arm of a group has."""
    arms = [each for each in members_of(cell.group) if each.arm not in CHEAPER]
    spent = {each.arm: cost_of(out / each.name) for each in arms}
    folder = out / cell.name.removesuffix("+")
    answers = len(load_run(folder).attempts)
    own = spent[cell.arm.removesuffix("+")]
    return int((max(spent.values()) - own) / (own / answers))


def members_of(group: str) -> list[Cell]:
    """The cells of a group, in their order."""
    return [each for each in planned() if each.group == group]


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
    """Performs a cell, unless it has ended; those that it follows must have ended."""
    folder = out / cell.name
    if has_ended(folder):
        return
    before = [cell.rules.rpartition(" ")[2]] if cell.rules else []
    if cell.arm in CHEAPER:
        own = members_of(cell.group)
        before = [each.name for each in own if each.arm not in CHEAPER]
    missing = [name for name in before if not has_ended(out / name)]
    if missing:
        raise SystemExit(f"{cell.name}: {missing[0]} has not ended")
    asked = questions / cell.group
    asked.mkdir(parents=True, exist_ok=True)
    tasks = load_set(cell.level)
    options = options_of(cell, out)
    limit = {"out": folder, "max_tokens": 100_000_000}
    synthesize(tasks, f"manual:{asked}", **limit, **options)


def has_ended(folder: Path) -> bool:
    """Whether a run has ended."""
    return (folder / "run.json").is_file() and load_run(folder).finished


def main() -> None:
    """Prints the plan, or performs it."""
    parser = argparse.ArgumentParser(description=__doc__)
    commands = parser.add_subparsers(dest="command", required=True)
    commands.add_parser("plan")
    commands.add_parser("questions")
    for name in ("run", "group"):
        command = commands.add_parser(name)
        command.add_argument("out", type=Path)
        command.add_argument("names", nargs="*", help="groups; all by default")
        command.add_argument("--questions", type=Path, required=True)
        command.add_argument("--jobs", type=int, default=2, help="groups at a time")
    options = parser.parse_args()
    if options.command == "plan":
        writer = csv.writer(sys.stdout, lineterminator="\n")
        writer.writerow(field.name for field in fields(Cell))
        writer.writerows(asdict(cell).values() for cell in planned())
        return
    if options.command == "questions":
        for cell in planned():
            print(cell.name, first_question_sha256(cell))
        return
    groups = dict.fromkeys(cell.group for cell in planned())
    chosen = [group for group in groups if not options.names or group in options.names]
    if options.command == "group":
        for cell in planned():
            if cell.group in chosen:
                perform(cell, options.out, options.questions)
        return

    def start(group: str) -> None:
        # Groups side by side, the arms of a group one after the other.
        words = [sys.executable, "-m", "benchmarks.feedback_trial", "group"]
        words += [str(options.out), group, "--questions", str(options.questions)]
        code = run_process(words, check=False).returncode
        print(json.dumps({"group": group, "exit": code}), flush=True)

    with ThreadPoolExecutor(options.jobs) as pool:
        list(pool.map(start, chosen))


def first_question_sha256(cell: Cell) -> str:
    """Hash of the first question of a cell, without rules."""
    template = load_template(cell.prompt)
    return sha256_of(problem_of(load_set(cell.level)).question((), template))


if __name__ == "__main__":
    main()
