"""`tdac doctor`: tries what works on this machine."""

from __future__ import annotations

import importlib.metadata
import importlib.util
import os
import platform
from dataclasses import asdict, dataclass

from rich.markup import escape
from rich.table import Table

from tdac_agent.cli.console import Console, print_json
from tdac_agent.cli.display import has_display
from tdac_agent.cli.trials import attempt
from tdac_agent.models.vendors import VENDORS
from tdac_agent.sandbox import available_tiers
from tdac_agent.storage.shipped import shipped, shipped_names
from tdac_envs.core.errors import TaskError
from tdac_envs.core.extras import install_command

EXTRAS = {
    "human": "pygame",
    "video": "moviepy",
    "sb3": "stable_baselines3",
    "ray": "ray",
    "ros2": "cyclonedds",
    "inspect": "inspect_ai",
    "mcp": "mcp",
    "studio": "nicegui",
    "physics": "mujoco",
}
"""The package of each extra, besides those of vendors."""
TRIALS = (
    ("compiled step", "compiled_step", True),
    ("verification", "verification", True),
    ("video (.mp4, .gif)", "video", False),
)
PACKAGES = ("tdac", "gymnasium", "numpy", "numba", "pytest", "opencv-python-headless")


@dataclass(frozen=True, slots=True)
class Check:
    """The result of one check.

    Attributes:
        name: Name of the check.
        works: Whether it passed.
        detail: What works, or why it does not and what to do.
        needed: Whether tdac is unusable without it.
        warning: Whether it passed, but will soon need attention.
    """

    name: str
    works: bool
    detail: str
    needed: bool = False
    warning: bool = False


def run(as_json: bool) -> int:
    """Prints the results of all checks; returns 3 if a required one failed, else 0."""
    checks = [*_sandbox(), *_trials(), _window(), *_extras(), *_keys()]
    # Last: this imports what the trials tried, and a crash would end this process.
    checks += _models() if _usable(checks) else []
    if as_json:
        record = {
            "checks": [asdict(check) for check in checks],
            "versions": _versions(),
        }
        print_json(record)
    else:
        show_checks(checks)
    return 0 if _usable(checks) else 3


def _usable(checks: list[Check]) -> bool:
    """Whether all required checks passed."""
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
        "none: controllers run only unconfined, with --tier rlimits; "
        "on Debian and Ubuntu: apt install bubblewrap"
    )
    return [*checks, Check("sandbox in use", best is not None, detail, needed=True)]


def _trials() -> list[Check]:
    """Results of the trials, each run in its own process."""
    checks = []
    with Console(stderr=True).status("") as status:
        for title, name, needed in TRIALS:
            status.update(f"trying {title} (compiles on first use) …")
            checks.append(Check(title, *attempt(name), needed))
    return checks


def _window() -> Check:
    if importlib.util.find_spec("pygame") is None:
        return Check("window", False, install_command("human"))
    if not has_display():
        return Check("window", False, "no display; videos work without one")
    return Check("window", True, "pygame")


def _extras() -> list[Check]:
    apis = [vendor.api for vendor in VENDORS.values()]
    extras = {api.extra: api.package for api in apis if api.extra is not None}
    checks = []
    for extra, module in {**EXTRAS, **extras}.items():
        is_installed = importlib.util.find_spec(module) is not None
        detail = module if is_installed else f"optional: {install_command(extra)}"
        if is_installed and extra == "physics":
            is_installed, detail = _physics()
        checks.append(Check(f"extra {extra}", is_installed, detail))
    return checks


def _physics() -> tuple[bool, str]:
    """Whether MuJoCo can be imported, and its version; or what clashes."""
    from tdac_envs.physics.engine import engine_version

    try:
        return True, engine_version()
    except TaskError as error:
        return False, str(error)


def _keys() -> list[Check]:
    """Whether API keys are set; does not print or validate them."""
    checks = []
    for name in (vendor.key for vendor in VENDORS.values()):
        is_set = bool(os.environ.get(name, "").strip())
        detail = "set" if is_set else f"optional: set {name} to use its models"
        checks.append(Check(f"key {name}", is_set, detail))
    return checks


def _models() -> list[Check]:
    """Whether models of the bundled campaigns are retired, or soon will be."""
    from tdac_agent.campaign.config import read_config
    from tdac_agent.models.choice import OFFLINE
    from tdac_agent.models.lifecycle import URGENT_DAYS, model_warnings, retired

    checks = []
    for name in shipped_names("*.yaml"):
        models = read_config(shipped(name)).models
        usable = not retired(models)
        soon = usable and bool(retired(models, within_days=URGENT_DAYS))
        notes = "; ".join(model_warnings(models))
        if notes:
            checks.append(Check(f"campaign {name}", usable, notes, warning=soon))
        elif any(model.partition(":")[0] not in OFFLINE for model in models):
            detail = "none of its models is known to be retired soon"
            checks.append(Check(f"campaign {name}", True, detail))
    return checks


def _versions() -> dict[str, str]:
    versions = {name: importlib.metadata.version(name) for name in PACKAGES}
    return {"python": platform.python_version(), **versions}


def show_checks(checks: list[Check]) -> None:
    """Prints a line per check with its mark, then the versions."""
    console = Console()
    grid = Table.grid(padding=(0, 1, 0, 0))
    grid.add_column()
    grid.add_column(no_wrap=True)
    grid.add_column(overflow="fold")
    for check in checks:
        grid.add_row(_mark(check), escape(check.name), escape(check.detail))
    console.print(grid)
    versions = ", ".join(f"{name} {value}" for name, value in _versions().items())
    console.print(f"\n{versions}", highlight=False)


def _mark(check: Check) -> str:
    if check.works:
        return "[yellow]![/]" if check.warning else "[green]✔[/]"
    return "[red]✘[/]" if check.needed else "[yellow]–[/]"
