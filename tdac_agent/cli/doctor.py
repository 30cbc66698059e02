"""`tdac doctor`: what works on this machine, by trying it."""

from __future__ import annotations

import importlib.metadata
import importlib.util
import json
import os
import platform
import sys
from dataclasses import asdict, dataclass

from rich.markup import escape
from rich.table import Table

from tdac_agent.cli.console import Console
from tdac_agent.cli.display import has_display
from tdac_agent.cli.trials import attempt
from tdac_agent.sandbox import available_tiers
from tdac_agent.storage.shipped import shipped, shipped_names
from tdac_envs.core.extras import install_command

EXTRAS = {
    "human": "pygame",
    "video": "moviepy",
    "sb3": "stable_baselines3",
    "anthropic": "anthropic",
    "openai": "openai",
    "ray": "ray",
}
TRIALS = (
    ("compiled step", "compiled_step", True),
    ("verification", "verification", True),
    ("video (.mp4, .gif)", "video", False),
)
KEYS = ("ANTHROPIC_API_KEY", "OPENAI_API_KEY")
PACKAGES = ("tdac", "gymnasium", "numpy", "numba", "pytest", "opencv-python-headless")


@dataclass(frozen=True, slots=True)
class Check:
    """One thing that was tried.

    Attributes:
        name: What.
        works: Whether it works here.
        detail: How, or why not and what to do.
        needed: Whether nothing works without it.
    """

    name: str
    works: bool
    detail: str
    needed: bool = False


def run(as_json: bool) -> int:
    """Tries everything and prints it; 3 where something needed does not work."""
    checks = [*_sandbox(), *_trials(), _window(), *_extras(), *_keys()]
    # These load what has been tried above, which would end this process, too.
    checks += _models() if _usable(checks) else []
    if as_json:
        record = {
            "checks": [asdict(check) for check in checks],
            "versions": _versions(),
        }
        sys.stdout.write(json.dumps(record, indent=2) + "\n")
    else:
        _show(checks)
    return 0 if _usable(checks) else 3


def _usable(checks: list[Check]) -> bool:
    """Whether everything works that is needed."""
    return all(check.works for check in checks if check.needed)


def _sandbox() -> list[Check]:
    tiers = available_tiers()
    checks = [
        Check(
            f"sandbox: {s.tier.name}", s.works, s.reason or ", ".join(s.tier.promises)
        )
        for s in tiers
    ]
    works = (s.tier.name for s in tiers if s.works and s.tier.promises)
    best = next(works, None)
    detail = best or (
        "none: controllers run only with --tier rlimits, unconfined; "
        "on Debian and Ubuntu: apt install bubblewrap"
    )
    return [*checks, Check("sandbox in use", best is not None, detail, needed=True)]


def _trials() -> list[Check]:
    """What a first hour needs, tried; films are no part of what is needed."""
    checks = []
    with Console(stderr=True).status("") as told:
        for title, name, needed in TRIALS:
            told.update(f"trying {title}; the first time it is compiled …")
            checks.append(Check(title, *attempt(name), needed))
    return checks


def _window() -> Check:
    if importlib.util.find_spec("pygame") is None:
        return Check("window", False, install_command("human"))
    if not has_display():
        return Check("window", False, "no display here; videos work without one")
    return Check("window", True, "pygame")


def _extras() -> list[Check]:
    checks = []
    for extra, module in EXTRAS.items():
        found = importlib.util.find_spec(module) is not None
        detail = module if found else f"optional: {install_command(extra)}"
        checks.append(Check(f"extra {extra}", found, detail))
    return checks


def _keys() -> list[Check]:
    """Whether there are keys; never what they are, nor whether they are accepted."""
    checks = []
    for name in KEYS:
        there = bool(os.environ.get(name, "").strip())
        detail = "set" if there else f"optional: set {name} to use these models"
        checks.append(Check(f"key {name}", there, detail))
    return checks


def _models() -> list[Check]:
    """Which models of the shipped campaigns are gone, or soon will be."""
    from tdac_agent.campaign.config import read_config
    from tdac_agent.models.choice import OFFLINE
    from tdac_agent.models.lifecycle import model_warnings, retired

    checks = []
    for name in shipped_names("*.yaml"):
        models = read_config(shipped(name)).models
        gone = retired(models)
        notes = model_warnings(models)
        if notes:
            checks.append(Check(f"campaign {name}", not gone, "; ".join(notes)))
        elif any(model.partition(":")[0] not in OFFLINE for model in models):
            detail = "none of its models is known to end soon"
            checks.append(Check(f"campaign {name}", True, detail))
    return checks


def _versions() -> dict[str, str]:
    versions = {name: importlib.metadata.version(name) for name in PACKAGES}
    return {"python": platform.python_version(), **versions}


def _show(checks: list[Check]) -> None:
    console = Console()
    grid = Table.grid(padding=(0, 1, 0, 0))
    grid.add_column()
    grid.add_column(no_wrap=True)
    grid.add_column(overflow="fold")
    for check in checks:
        mark = "[green]✔[/]" if check.works else "[yellow]–[/]"
        if check.needed and not check.works:
            mark = "[red]✘[/]"
        grid.add_row(mark, escape(check.name), escape(check.detail))
    console.print(grid)
    versions = ", ".join(f"{name} {value}" for name, value in _versions().items())
    console.print(f"\n{versions}", highlight=False)
