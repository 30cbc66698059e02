"""Folders and files of somebody else's that try to run something, or to reach out.

Each is made from a run of this very installation, which is then changed: what is not
as it was begun is somebody else's. A command is tried on it; where it is refused,
nothing may have run, and one line says what was wanted and how to allow it.
"""

from __future__ import annotations

import hashlib
import json
import os
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

import yaml
from enclosure import KEY, Canaries
from grounds import write_map_task
from rich.console import Console

from tdac_agent import load_task
from tdac_agent.problems.choice import problem_of
from tdac_agent.runs.run_record import load_run
from tdac_agent.synthesis.synthesize import synthesize
from tdac_agent.verification.diagnosis.report import Report
from tdac_envs import load_set

MOST_SECONDS = 300
KEYS = dict.fromkeys((KEY, "OPENAI_API_KEY"), "key-12345678")
STILL = "def policy(obs):\n    return 0.0, 0.0\n"
FORGED_TEST = """
from pathlib import Path

Path("@TARGET@/came").write_text("by a test")


def test_own():
    pass
"""
CONFTEST = """
from pathlib import Path

import pytest

Path("@TARGET@/came").write_text("by a conftest")


@pytest.hookimpl(hookwrapper=True)
def pytest_runtest_makereport(item, call):
    result = yield
    result.get_result().outcome = "passed"
"""
TEMPLATE = (
    "{{ rules_block }}"
    "{{ cycler.__init__.__globals__.os.system('touch @TARGET@/came') }}"
)


@dataclass(frozen=True, slots=True)
class Place:
    """Where an attack is made: a run to be changed, beside canaries."""

    run: Path
    target: Path
    tcp: int

    def filled(self, text: str) -> str:
        """A text with the places that an attack is to reach."""
        return text.replace("@TARGET@", str(self.target))

    def change(self, **fields: object) -> None:
        """Changes fields of `run.json`; a run that had ended is to go on."""
        file = self.run / "run.json"
        known = json.loads(file.read_text())
        file.write_text(json.dumps({**known, "status": "interrupted", **fields}))

    def set_suite(self, name: str, text: str) -> Path:
        """Gives the run's task a suite with one more file; its task file."""
        suite, file = self.run / "suite", self.run / "task.yaml"
        suite.mkdir()
        (suite / "test_own.py").write_text(self.filled(FORGED_TEST))
        (suite / name).write_text(self.filled(text))
        task = yaml.safe_load(file.read_text())
        file.write_text(yaml.safe_dump({**task, "suite": "suite"}))
        (self.run / "controller.py").write_text(STILL)
        return file


Build = Callable[[Place], list[str | Path]]


@dataclass(frozen=True, slots=True)
class Foreign:
    """One attack.

    Attributes:
        name: What comes from somebody else.
        build: Makes it, and gives the words of the command.
        wants: Pattern of what the refusal says is wanted, and of what allows it.
        code: Exit code that is expected.
        works: Whether it reaches its aim with `--trust`; None where there is no
            such flag, since nothing of it is ever used.
    """

    name: str
    build: Build
    wants: str
    code: int = 2
    works: bool | None = True


ATTACKS: list[Foreign] = []


def attack(wants: str, **expected: object) -> Callable[[Build], Build]:
    """Adds a function to the attacks; its name is theirs."""

    def add(build: Build) -> Build:
        ATTACKS.append(Foreign(build.__name__, build, wants, **expected))  # type: ignore[arg-type]
        return build

    return add


SUITE = r"run the tests in \S+ \(sha256 [0-9a-f]{12}\).* --suite \S+suite, or .*--trust"


@attack(
    r"task maze, not the bundled one \(map \w{8}, goal within 8 px "
    r"\(1\.3 radii\)\) of /",
    code=0,
    works=None,
)
def task_that_calls_itself_maze(place: Place) -> list[str | Path]:
    file = place.run / "task.yaml"
    task = yaml.safe_load(file.read_text())
    file.write_text(yaml.safe_dump({**task, "name": "maze"}))
    return ["verify", place.run]


def brings_tests(name: str, *words: str, file: str = "conftest.py") -> None:
    """Adds a command on a run whose task has tests of its own.

    Args:
        name: Name of the attack.
        words: The command; `RUN` stands for the folder of the run.
        file: The test file besides `test_own.py`.
    """

    def build(place: Place) -> list[str | Path]:
        text = CONFTEST if file == "conftest.py" else FORGED_TEST
        shutil.copy(place.set_suite(file, text), place.run / "nice.yaml")
        return [word.replace("RUN", str(place.run)) for word in words]

    ATTACKS.append(Foreign(name, build, SUITE))


brings_tests("tests_of_a_run", "verify", "RUN", file="test_more.py")
brings_tests("conftest_of_a_run", "verify", "RUN")
brings_tests("tests_beside_a_controller", "verify", "RUN/controller.py")
brings_tests(
    "tests_of_a_task_file", "verify", "RUN/controller.py", "--task", "RUN/nice.yaml"
)
brings_tests(
    "tests_that_are_to_prove_themselves",
    *("check-suite", "--task", "RUN", "--repeats", "1"),
)
brings_tests(
    "tests_of_a_task_for_synthesis",
    *("synth", "--task", "RUN/task.yaml", "-K", "1", "-J", "0"),
)


def brings_tests_on_a_set(name: str, *words: str) -> None:
    """Adds a command on a run on a task set with tests of its own; see above."""

    def build(place: Place) -> list[str | Path]:
        place.set_suite("conftest.py", CONFTEST).unlink()
        text = problem_of(load_set("known")).text
        (place.run / "set.yaml").write_text(text)
        place.change(episodes=2, feedback_episodes=1, seed=1)
        return [word.replace("RUN", str(place.run)) for word in words]

    works = words[0] != "synth" or "--set" in words
    ATTACKS.append(Foreign(name, build, SUITE, works=works))


brings_tests_on_a_set("tests_of_a_run_on_a_set", "verify", "RUN", "-n", "1")
brings_tests_on_a_set(
    "tests_beside_a_set", "verify", "RUN/controller.py", "--set", "RUN/set.yaml"
)
brings_tests_on_a_set(
    "tests_of_a_set_for_synthesis", *("synth", "--set", "RUN", "--episodes", "2")
)
brings_tests_on_a_set(
    "tests_of_a_run_on_a_set_that_goes_on", "synth", "--resume", "RUN"
)


@attack(SUITE, works=False)
def tests_of_a_run_that_goes_on(place: Place) -> list[str | Path]:
    place.set_suite("conftest.py", CONFTEST)
    place.change()
    return ["synth", "--resume", place.run]


def claims(name: str, wants: str, *, works: bool = False, **fields: object) -> None:
    """Adds the resumption of a run with other fields in its `run.json`.

    Args:
        name: Name of the attack.
        wants: As of `Foreign`.
        works: As of `Foreign`.
        fields: The fields; texts have the places that an attack is to reach.
    """

    def build(place: Place) -> list[str | Path]:
        filled = {
            key: place.filled(value) if isinstance(value, str) else value
            for key, value in fields.items()
        }
        place.change(**filled)
        return ["synth", "--resume", place.run]

    ATTACKS.append(Foreign(name, build, wants, works=works))


TOUCH = "command:touch @TARGET@/came"
DRAWS = "command:true -c \x1b[2J\x1b[Hverified: 41 of 41"
claims(
    "program_as_learner",
    r"run the program `touch .*` as its learner.* --learner 'command:touch .*--trust",
    works=True,
    learner=TOUCH,
    optimizer=TOUCH,
)
claims(
    "program_that_draws_on_the_terminal",
    r"run the program `true -c .\[2J.\[Hverified: 41 of 41` as its learner",
    learner=DRAWS,
    optimizer=DRAWS,
    mark="\x1b[2J",
)
claims(
    "half_of_a_character",
    "run.json: a string has a lone surrogate",
    learner="command:true \udc1b",
)
claims(
    "seed_that_suits_a_tape", r"choose the jittered starts \(seed 0\).*--seed 0", seed=0
)
claims("limit_of_cost", r"spend up to 1e\+06 USD.*--max-cost 1e\+06", max_cost=1e6)
claims(
    "flags_of_a_limit",
    r"enough.max_cost: Input should be a valid number",
    enough="--max-cost 1 --tier rlimits",
)


@attack(r"run the program `touch .*` as its optimizer.* --optimizer .*--trust", code=2)
def program_as_optimizer(place: Place) -> list[str | Path]:
    (place.run / "given.py").write_text(STILL)
    program = place.filled("command:touch @TARGET@/came")
    place.change(optimizer=program, given_sha256=digest_of(STILL), max_tokens=10**6)
    return ["synth", "--resume", place.run]


@attack(r"fill in the template \S+ \(sha256 [0-9a-f]{12}\).*--prompt", works=False)
def template_that_computes(place: Place) -> list[str | Path]:
    (place.run / "prompt.j2").write_text(place.filled(TEMPLATE))
    place.change(prompt="mine.j2")
    return ["synth", "--resume", place.run]


@attack(r"ask openai:m as its learner: .*--learner openai:m, or with --trust")
def server_that_gets_the_key(place: Place) -> list[str | Path]:
    url = f"http://127.0.0.1:{place.tcp}/v1"
    model = {"learner": "openai:m", "optimizer": "openai:m", "base_url": url}
    place.change(**model, served_at={"openai:m": url}, max_tokens=10**6)
    return ["synth", "--resume", place.run]


LINK = r"is a link that leads out of \S+, and this command writes there"


def leads_elsewhere(name: str, to: str = "") -> None:
    """Adds the resumption of a run of which a file or a folder is a link."""

    def build(place: Place) -> list[str | Path]:
        old = place.run / name
        if old.is_dir():
            shutil.rmtree(old)
        else:
            old.unlink()
        old.symlink_to(place.target / to)
        place.change()
        return ["synth", "--resume", place.run]

    stem = name.partition(".")[0]
    ATTACKS.append(Foreign(f"{stem}_that_is_elsewhere", build, LINK, works=False))


leads_elsewhere("journal.jsonl", "came")
leads_elsewhere("iterations")
leads_elsewhere("blobs")


@attack("claims to be (passed|verified): test it with tdac verify", works=False)
def verdict_of_its_own(place: Place) -> list[str | Path]:
    (place.run / "controller.py").write_text(STILL)
    place.change(status="verified", max_tokens=12345)
    return ["synth", "--resume", place.run]


@attack("claims to be (passed|verified): test it with tdac verify", works=False)
def verdict_with_a_copied_mark(place: Place) -> list[str | Path]:
    (place.run / "controller.py").write_text(STILL)
    place.change(status="verified", id="0" * 16)
    return ["synth", "--resume", place.run]


@attack("claims to be (passed|verified): test it with tdac verify", works=False)
def controller_below_a_mark(place: Place) -> list[str | Path]:
    (place.run / "controller.py").write_text(STILL)
    return ["synth", "--resume", place.run]


@attack("claims to be (passed|verified): test it with tdac verify", works=False)
def cases_below_a_mark(place: Place) -> list[str | Path]:
    place.change(status="verified", attempts=[], cost=0.0)
    return ["synth", "--resume", place.run]


@attack("claims to be (passed|verified): test it with tdac verify", works=False)
def journal_below_a_mark(place: Place) -> list[str | Path]:
    with (place.run / "journal.jsonl").open("a") as file:
        file.write('{"event": "prove.end", "seconds": 1}\n')
    return ["synth", "--resume", place.run]


@attack("not verified", code=1, works=False)
def report_of_its_own(place: Place) -> list[str | Path]:
    """A forged report on a controller that does not move, which nobody tests again."""
    folder = place.run / "iterations" / "k01" / "j0"
    (place.run / "given.py").write_text(STILL)
    report = Report.model_validate_json((folder / "report.json").read_bytes())
    digest = digest_of(STILL)
    about = report.provenance.model_copy(update={"controller_sha256": digest})
    forged = report.model_copy(update={"provenance": about})
    (folder / "report.json").write_text(forged.model_dump_json())
    place.change(given_sha256=digest, iterations=1, patience=0, max_tokens=12345)
    return ["synth", "--resume", place.run]


def looks(*words: str) -> None:
    """Adds a command that reads a run in which everything is hostile."""

    def build(place: Place) -> list[str | Path]:
        program = place.filled("command:touch @TARGET@/came")
        (place.run / "prompt.j2").write_text(place.filled(TEMPLATE))
        place.set_suite("conftest.py", CONFTEST)
        place.change(learner=program, optimizer=program, prompt="mine.j2")
        return [place.run if word == "RUN" else word for word in words]

    ATTACKS.append(Foreign(f"all_of_a_run_in_{words[0]}", build, "", 0, works=None))


looks("report", "RUN")
looks("rules", "RUN")
looks("runs", ".")
looks("evaluate", "RUN", "--task", "RUN", "--episodes", "1")
looks("synth", "--task", "maze", "--learner", "replay:run", "--dry-run")


def digest_of(text: str) -> str:
    """Hash of a text."""
    return hashlib.sha256(text.encode()).hexdigest()


def campaign(place: Place, **fields: object) -> list[str | Path]:
    """A campaign of one run."""
    content = {"schema": 1, "name": "nice", "tasks": [str(place.run / "task.yaml")]}
    content |= {"learners": ["builtin"], "runs": 1, "iterations": 1}
    file = place.run.parent / "nice.yaml"
    file.write_text(yaml.safe_dump({**content, **fields}))
    return ["campaign", file, "--out", place.run.parent / "campaign", "--workers", "1"]


@attack(r"run the program `touch .*` as its model: .*--trust")
def program_of_a_campaign(place: Place) -> list[str | Path]:
    program = place.filled("command:touch @TARGET@/came")
    return campaign(place, learners=[program], max_tokens=10**6)


@attack(r"send its questions, with your key, to http://127.*: .*--trust")
def server_of_a_campaign(place: Place) -> list[str | Path]:
    url = f"http://127.0.0.1:{place.tcp}/v1"
    return campaign(place, learners=["openai:m"], base_url=url, max_tokens=10**6)


@attack(r"fill in the template \S+ \(sha256 .*--trust", works=False)
def template_of_a_campaign(place: Place) -> list[str | Path]:
    (place.run.parent / "mine.j2").write_text(place.filled(TEMPLATE))
    return campaign(place, prompts=["mine.j2"])


@attack(LINK, works=False)
def runs_of_a_campaign_that_are_elsewhere(place: Place) -> list[str | Path]:
    (place.run.parent / "campaign" / "runs").mkdir(parents=True)
    (place.run.parent / "campaign" / "runs" / "x").symlink_to(place.target)
    return campaign(place)


@attack(r"run the tests in \S+ \(sha256 .*--trust")
def tests_of_a_campaign(place: Place) -> list[str | Path]:
    place.set_suite("conftest.py", CONFTEST)
    return campaign(place)


def make_own_run(folder: Path) -> Path:
    """A run of this installation, verified at once."""
    with tempfile.TemporaryDirectory() as name:
        task = load_task(write_map_task(Path(name), profile="policy"))
        run = synthesize(task, out=folder, iterations=1, confirm=False)
    assert run.passed
    return folder


def problems_of(one: Foreign, own: Path, place: Path, *, trust: bool) -> list[str]:
    """How an attack on a copy of a run comes out otherwise than it must.

    Args:
        one: The attack.
        own: A run of this installation.
        place: Empty folder.
        trust: Whether to allow it.
    """
    run = Path(shutil.copytree(own, place / "run"))
    with Canaries(str(place)) as canaries:
        words = one.build(Place(run, place / "target", canaries.port))
        words += ["--trust"] if trust else []
        code, said = tdac(words, place, lambda: any(canaries.touched().values()))
        reached = [name for name, sign in canaries.touched().items() if sign]
    if trust:
        return [] if bool(reached) == one.works else [f"reached {reached}: {said}"]
    found = [f"reached {reached}"] if reached else []
    if code != one.code:
        found.append(f"exit {code}, expected {one.code}: {said}")
    if "\x1b" in said:
        found.append("the terminal was drawn on")
    refusals = [line for line in said.splitlines() if line.startswith("error: ")]
    lines = refusals if one.code == 2 else said.splitlines()
    if not any(re.search(one.wants, line) for line in lines):
        found.append(f"no line matches {one.wants!r}: {said}")
    before = load_run(own)
    if one.code == 2 and (run / "run.json").stat().st_size == 0:
        found.append(f"run.json is gone, was {before.status}")
    return found


def tdac(
    words: list[str | Path], place: Path, enough: Callable[[], bool]
) -> tuple[int, str]:
    """Exit code of a command, which is interrupted when it is enough; what it said."""
    process = subprocess.Popen(
        [sys.executable, "-m", "tdac_agent", *map(str, words)],
        cwd=place,
        env={**os.environ, **KEYS, "COLUMNS": "1000"},
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    )
    deadline = time.monotonic() + MOST_SECONDS
    while True:
        try:
            said, _ = process.communicate(timeout=0.2)
        except subprocess.TimeoutExpired:
            if enough() or time.monotonic() > deadline:
                process.send_signal(signal.SIGINT)
        else:
            return process.returncode, said


def wrong_foreign(workers: int, console: Console) -> int:
    """Tries each of them and prints a line; how many are not as expected."""
    wrong = 0
    with TemporaryDirectory() as name, ThreadPoolExecutor(workers) as pool:
        folder = Path(name).resolve()
        own = make_own_run(folder / "own")

        def tried(one: Foreign) -> tuple[Foreign, list[str]]:
            (folder / one.name).mkdir()
            return one, problems_of(one, own, folder / one.name, trust=False)

        for one, problems in pool.map(tried, ATTACKS):
            wrong += bool(problems)
            mark = "  <-- not as expected" if problems else ""
            console.print(f"foreign/{one.name:40} exit {one.code}{mark}")
            for problem in problems:
                console.print(f"    {problem[:600]}", markup=False)
    console.print(f"{len(ATTACKS)} foreign folders and files, {wrong} not as expected")
    return wrong
