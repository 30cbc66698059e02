"""Plans the runs of a campaign; a run's name follows from its configuration."""

from __future__ import annotations

import importlib.metadata
import json
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from itertools import product
from pathlib import Path
from typing import Any

from tdac_agent.campaign.config import (
    SAME,
    CampaignConfig,
    CampaignError,
    required_permissions,
)
from tdac_agent.models.choice import Options, answers_sha256
from tdac_agent.models.prices import FREE
from tdac_agent.prompting.prompt import (
    PromptTemplate,
    generate_prompt,
    is_shipped,
    load_template,
)
from tdac_agent.prompting.set_prompt import check_generated, set_prompt
from tdac_agent.runs.ownership import load_task
from tdac_agent.runs.run_record import RACES, LoopSetting
from tdac_agent.storage.hashes import sha256_of, sha256_of_json
from tdac_agent.tasks.setting import Setting as TaskSetting
from tdac_agent.tasks.task import Task
from tdac_agent.tasks.task_file import bundled_task
from tdac_agent.tasks.trust import permit
from tdac_agent.verification.verify import suite_sha256
from tdac_envs.ladder.set_file import shipped_names as shipped_sets
from tdac_envs.ladder.task_sets import TaskSet, load_set

SET_LIMITS = ("episodes", "feedback_episodes")
"""Limits of runs on task sets."""


@dataclass(frozen=True, slots=True)
class Cell:
    """A kind of run: its runs differ only in index and seed.

    Attributes:
        folder: Name of the folder of its runs.
        task: Bundled name or absolute path of the task or task set.
        task_name: Name of the task, or `set NAME`, for display.
        learner: LLM1.
        optimizer: LLM2.
        setting: Which parts of the loop are used.
        prompt: Template of the first question, a name or an absolute path.
        iterations: K.
        patience: J.
        refine: Whether failures become rules.
        base_url: URL of the models' server; None for the default.
        max_output: Token limit of an answer.
        episodes: Limit of simulated episodes on a task set; None on a task.
        feedback_episodes: Most episodes of a test on a task set; None on a task.
        options: Further options, as names and values.
    """

    folder: str
    task: str
    task_name: str
    learner: str
    optimizer: str
    setting: LoopSetting
    prompt: str
    iterations: int
    patience: int
    refine: bool
    base_url: str | None
    max_output: int
    episodes: int | None = None
    feedback_episodes: int | None = None
    options: tuple[tuple[str, Any], ...] = ()

    @property
    def on_set(self) -> bool:
        """Whether its runs are on a task set."""
        return self.episodes is not None

    @property
    def search(self) -> dict[str, Any]:
        """Options of `tdac synth` that its setting stands for, beside K and J."""
        chosen: dict[str, Any] = {
            "search": "race" if self.setting in RACES else "paper"
        }
        if self.setting == "first answers":
            chosen["candidates"] = self.iterations
        return chosen

    @property
    def asks_models(self) -> bool:
        """Whether its runs may cost money."""
        return not {n.partition(":")[0] for n in (self.learner, self.optimizer)} <= FREE


@dataclass(frozen=True, slots=True)
class PlannedRun:
    """One run of a campaign.

    Attributes:
        cell: Kind of the run.
        index: Number of the run within its cell, from 1.
        seed: Seed of its jittered starts or worlds; None if the file has none.
    """

    cell: Cell
    index: int
    seed: int | None

    @property
    def name(self) -> str:
        """Its folder, relative to the folder of all runs; the same in every plan."""
        return f"{self.cell.folder}/r{self.index:04d}"

    def to_json(self) -> str:
        """Serializes the run for another process."""
        return json.dumps(asdict(self))

    @classmethod
    def from_json(cls, text: str) -> PlannedRun:
        """The run that `to_json` serialized."""
        content = json.loads(text)
        cell = content["cell"]
        cell["options"] = tuple(map(tuple, cell["options"]))
        return cls(**{**content, "cell": Cell(**cell)})


@dataclass(frozen=True, slots=True)
class Shard:
    """Every n-th run of a plan, starting with the i-th."""

    i: int = 1
    n: int = 1

    @classmethod
    def parse(cls, text: str) -> Shard:
        """Parses `i/n`.

        Raises:
            CampaignError: The text is not `i/n` with 1 <= i <= n.
        """
        match = re.fullmatch(r"(\d+)/(\d+)", text)
        if match is None or not 1 <= int(match[1]) <= int(match[2]):
            raise CampaignError(f"expected --shard as in 1/4, got {text!r}")
        return cls(int(match[1]), int(match[2]))


WHOLE = Shard()


@dataclass(frozen=True, slots=True)
class Plan:
    """The runs of a campaign.

    Attributes:
        cells: The kinds of run, in the file's order.
        tasks: Tasks by `Cell.task`.
        sets: Task sets by `Cell.task`.
        runs: R: runs of each kind.
        seed: Seed of the first run; None if the file has none.
    """

    cells: tuple[Cell, ...]
    tasks: Mapping[str, Task]
    sets: Mapping[str, TaskSet]
    runs: int
    seed: int | None

    def problem(self, cell: Cell) -> Task | TaskSet:
        """The task or task set of a cell."""
        return self.sets[cell.task] if cell.on_set else self.tasks[cell.task]

    def __len__(self) -> int:
        return len(self.cells) * self.runs

    def all(self, shard: Shard = WHOLE) -> Iterator[PlannedRun]:
        """Yields the runs of a shard: the first of each kind, then the second, etc.

        So a stopped campaign has about equally many runs of every kind.
        """
        numbered = product(range(1, self.runs + 1), self.cells)
        for number, (index, cell) in enumerate(numbered):
            if number % shard.n == shard.i - 1:
                seed = None if self.seed is None else self.seed + index - 1
                yield PlannedRun(cell, index, seed)


def make_plan(config: CampaignConfig, base: Path, *, trust: bool = False) -> Plan:
    """Plans a campaign; reads its tasks, which must be feasible.

    Args:
        config: Contents of the campaign file.
        base: Folder of the campaign file.
        trust: Whether the file has all permissions that it needs.

    Raises:
        NotTrustedError: The file names a program, a server, a template or tests, and
            `trust` is false.
        TdacError: A task or a prompt cannot be used.
    """

    def path_of(name: str, *, known: bool) -> str:
        """A name that is known everywhere, or an absolute path."""
        return name if known else str((base / name).resolve())

    tasks, sets = dict[str, tuple[str, Task]](), dict[str, tuple[str, TaskSet]]()
    for name in config.tasks:
        path = path_of(name, known=bundled_task(name) is not None)
        tasks[name] = path, load_task(path)
    for name in config.sets:
        path = path_of(name, known=name in shipped_sets())
        sets[name] = path, load_set(path)
    wishes = required_permissions(config, base, [task for _, task in tasks.values()])
    permit(f"the campaign {config.name}", wishes, trust=trust)
    tasks = {n: (path, replace(t, trusted=True)) for n, (path, t) in tasks.items()}
    prompts = {n: path_of(n, known=is_shipped(n)) for n in config.prompts}
    problems: list[tuple[str, Task | TaskSet]] = [*tasks.values(), *sets.values()]
    kinds = product(
        problems,
        config.learners,
        config.optimizers,
        config.prompts,
        config.settings,
    )
    cells = [
        _cell(config, *each, learner, optimizer, prompt, prompts[prompt], setting)
        for each, learner, optimizer, prompt, setting in kinds
    ]
    return Plan(
        tuple(dict.fromkeys(cells)),
        dict(tasks.values()),
        dict(sets.values()),
        config.runs,
        config.seed,
    )


def _cell(
    config: CampaignConfig,
    path: str,
    task: Task | TaskSet,
    learner: str,
    optimizer: str,
    prompt: str,
    template: str,
    setting: LoopSetting,
) -> Cell:
    """One kind of run; its folder name has a hash of all that its runs depend on."""
    iterations, patience, refine = loop_of(config, setting)
    on_set = isinstance(task, TaskSet)
    facts: dict[str, Any] = {
        "task_name": f"set {task.name}" if on_set else task.name,
        "learner": learner,
        "optimizer": learner if optimizer == SAME else optimizer,
        "setting": setting,
        "iterations": iterations,
        "patience": patience,
        "refine": refine,
        "base_url": config.base_url,
        "max_output": config.max_output,
    }
    if on_set:
        facts |= {name: getattr(config, name) for name in SET_LIMITS}
    # Plans without further options keep the names of their runs.
    if config.options:
        facts["options"] = tuple(sorted(config.options.items()))
    question = question_of(task, load_template(template))
    hashed = facts | {
        **_hashes(task),
        "prompt": sha256_of(question),
        "version": importlib.metadata.version("tdac"),
        "seed": config.seed,
    }
    options = Options(setting_of(task), config.base_url)
    for model in {facts["learner"], facts["optimizer"]}:
        answers = answers_sha256(model, options)
        if answers is not None:
            hashed[f"answers of {model}"] = answers
    digest = sha256_of_json(hashed)
    shown = [
        facts["task_name"],
        learner,
        setting,
        *([prompt] if prompt != "full" else []),
    ]
    folder = f"{slug('-'.join(shown))}-{digest[:8]}"
    return Cell(folder=folder, task=path, prompt=template, **facts)


def setting_of(problem: Task | TaskSet) -> TaskSetting | TaskSet:
    """What models may have to know of a task or task set."""
    return problem if isinstance(problem, TaskSet) else problem.setting


def question_of(problem: Task | TaskSet, template: PromptTemplate) -> str:
    """The first question on a task or task set."""
    if isinstance(problem, TaskSet):
        check_generated(problem)
        return set_prompt(problem, (), template)
    return generate_prompt(problem, (), template)


def _hashes(problem: Task | TaskSet) -> dict[str, str]:
    """Hashes of what a candidate is tested with."""
    if isinstance(problem, TaskSet):
        return {"set": problem.sha256, "dynamics": problem.dynamics}
    own = {"task": problem.sha256(), "dynamics": problem.dynamics()}
    return {**own, "suite": suite_sha256(problem)}


def loop_of(config: CampaignConfig, setting: LoopSetting) -> tuple[int, int, bool]:
    """K, J and whether failures become rules, for a setting."""
    iterations, edits = config.iterations, config.patience
    samples = config.samples or iterations * (edits + 2)
    return {
        "dual tier": (iterations, edits, True),
        "edit only": (iterations, edits, False),
        "prompt only": (iterations, 0, True),
        "best of N": (samples, 0, False),
        "one shot": (1, 0, False),
        "race": (iterations, 0, False),
        "first answers": (iterations, 0, False),
    }[setting]


def slug(text: str, most: int = 60) -> str:
    """Turns a text into part of a file name, of at most `most` characters."""
    return re.sub(r"[^a-z0-9.]+", "-", text.lower()).strip("-.")[:most].rstrip("-.")


def models_of(cells: Sequence[Cell]) -> tuple[str, ...]:
    """The models of the cells, without duplicates."""
    return tuple(dict.fromkeys(n for c in cells for n in (c.learner, c.optimizer)))
