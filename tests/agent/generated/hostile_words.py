"""Command lines of every command, each with one word written otherwise.

A line gets past the first check when its flags and their types are understood; at
least half of those that are generated do. `JUDGED` lines come as far as an episode.
"""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import yaml
from hostile_files import CAMPAIGN, JOURNAL_LINES, MAP_TASK, RULES, RUN, draw
from hostile_values import TEXTS
from hypothesis import strategies as st

WORLD = """#VRML_SIM R2025a utf8
RectangleArena { floorSize 1 1 }
E-puck { translation -0.3 0 0 }
DEF GOAL Solid { translation 0.3 0 0 }
Foo { translation 0.4 0.4 0 }
"""
ENDS = ("--start", "8", "8", "--goal", "32", "20")
READING: dict[str, tuple[str, ...]] = {
    "map": (
        *("map", "plan.png", *ENDS, "--robot-radius", "3", "--snap"),
        *("--preset", "default", "--out", "made", "--json"),
    ),
    "ros map": (
        *("map", "map.yaml", "--metres", "--start", "0.4", "0.4", "--goal", "1.6"),
        *("1.0", "--robot-radius", "0.15", "--preset", "paper"),
    ),
    "world": ("world", "w.wbt", "--png", "w.png", "--json"),
    "task": (
        *("synth", "--task", "task.yaml", "--dry-run", "--iterations", "3"),
        *("--patience", "1", "--max-cost", "1", "--max-tokens", "9000000"),
        *("--max-output", "500", "--prompt", "full", "--seed", "3", "--json"),
    ),
    "flags": (
        *("synth", "--map", "plan.png", *ENDS, "--heading", "0.5", "--dry-run"),
        *("--robot-radius", "3", "--snap", "--instructions", "Slowly.", "--no-refine"),
        *("--robot-image", "robot.png", "--learner", "builtin"),
    ),
    "world flags": (
        *("synth", "--world", "w.wbt", "--start", "-0.3", "0.1", "--goal", "0.3", "0"),
        *("--heading", "1", "--ignore", "Foo", "--dry-run", "--trust"),
    ),
    "replay": ("synth", "--task", "task.yaml", "--learner", "replay:run", "--dry-run"),
    "resume": ("synth", "--resume", "run", "--dry-run", "--max-cost", "1"),
    "rules": ("rules", "run", "--json"),
    "runs": ("runs", ".", "--json"),
    "campaign": (
        *("campaign", "few.yaml", "--dry-run", "--workers", "2", "--max-cost", "1"),
        *("--max-tokens", "1000", "--out", "few", "--shard", "1/2", "--json"),
    ),
}
JUDGED: dict[str, tuple[str, ...]] = {
    "verify": (
        *("verify", "controller.py", "--task", "task.yaml", "--profile", "policy"),
        *("--paper", "--seed", "1", "--tier", "auto", "--robust", "2", "--delay", "1"),
        *("--range-noise", "0.1", "--wheel-slip", "0.1", "--motor-lag", "0.1"),
        *("--first-seed", "3", "--out", "made", "--junit", "junit.xml", "--json"),
    ),
    "play": (
        *("play", "controller.py", "--task", "task.yaml", "--seed", "1", "--tier"),
        *("auto", "--delay", "1", "--range-noise", "0.1", "--video", "drive.mp4"),
    ),
    "evaluate": (
        *("evaluate", "reference", "random", "--task", "task.yaml", "--episodes", "1"),
        *("--seed", "1", "--variation", "jitter", "--wrapper", "flatten"),
        *("--csv", "made.csv", "--out", "made", "--json", "--tier", "auto"),
    ),
}
ALL = READING | JUDGED
FILES = ("task.yaml", "plan.png", "map.yaml", "w.wbt", "run", "controller.py", "pipe")
NUMBERS = (
    *("0", "-1", "1", "2", "-0.5", "nan", "inf", "-inf", "1e9", "1e10", "1e-10"),
    *("1e300", "-1e300", "1e-300", "9" * 30, "9" * 5000, "4294967296", "0x10", "1_0"),
    *("\N{ARABIC-INDIC DIGIT ONE}", "\N{SUPERSCRIPT TWO}", "1e400"),
)
INTEGERS = ("1", "2", "3", "7", "100", "4096", "4097", "100000", "9" * 18)
COUNTS = {
    *("--iterations", "--patience", "--max-tokens", "--max-output", "--seed"),
    *("--robust", "--first-seed", "--delay", "--workers", "--episodes"),
}
COSTS = ("0", "1", "0.5", "1e9", "1e300", "1e-300", "nan", "inf")
CHOICES = {
    "--preset": ["default", "paper"],
    "--profile": ["policy", "paper"],
    "--variation": ["jitter", "random", "nominal", "mixed"],
}
# A null character ends a word, and a shell gives bytes that are no text as these.
WORDS = [text.replace("\0", "") for text in TEXTS if "\ud800" not in text] + ["\udcff"]


def furnish(folder: Path) -> None:
    """Writes the files that the lines name."""
    draw(folder)
    (folder / "task.yaml").write_text(yaml.safe_dump(MAP_TASK))
    (folder / "map.yaml").write_text("{image: plan.png, resolution: 0.05}")
    (folder / "w.wbt").write_text(WORLD)
    (folder / "few.yaml").write_text(yaml.safe_dump(CAMPAIGN))
    (folder / "controller.py").write_text("def policy(obs):\n    return 1.0, 1.0\n")
    run = folder / "run"
    run.mkdir()
    (run / "run.json").write_text(json.dumps(RUN))
    (run / "rules.json").write_text(json.dumps(RULES))
    lines = [json.dumps(line) + "\n" for line in JOURNAL_LINES["lines"]]
    (run / "journal.jsonl").write_text("".join(lines))
    shutil.copy(folder / "task.yaml", run)
    draw(run)


@st.composite
def lines(draw: st.DrawFn, usual: tuple[str, ...]) -> list[str]:
    """A line in which one word is another, gone, doubled, or one more."""
    words = list(usual)
    kind = draw(st.integers(0, 24))
    # Without it a campaign would be carried out.
    others = [at for at, word in enumerate(words) if at and word != "--dry-run"]
    at = draw(st.sampled_from(others))
    if kind == 17:
        del words[at]
    elif kind == 18:
        words.insert(at, draw(st.sampled_from(WORDS)))
    elif kind == 19:
        words.append(draw(st.sampled_from([word for word in usual if word[:1] == "-"])))
    else:
        at = draw(st.sampled_from([at for at in others if words[at][:2] != "--"]))
        words[at] = draw(_like(words, at))
    return words


def _like(words: list[str], at: int) -> st.SearchStrategy[str]:
    """Hostile words for one of a line, mostly such as its flag understands."""
    odd = st.sampled_from([*FILES, *WORDS, *NUMBERS])
    if words[at - 1] in COUNTS:
        return st.sampled_from([*INTEGERS * 12, *NUMBERS])
    if words[at - 1] == "--max-cost":
        return st.sampled_from([*COSTS * 12, *NUMBERS])
    if words[at - 1] in CHOICES:
        return st.sampled_from(CHOICES[words[at - 1]] * 12) | odd
    try:
        float(words[at])
    except ValueError:
        return odd
    return st.sampled_from([*NUMBERS * 8, *WORDS])
