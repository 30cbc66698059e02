"""`tdac verify --recorded`: a recorded drive, compared with its controller."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path

from rich.markup import escape
from rich.table import Table

from tdac_agent.cli.console import Console, print_json
from tdac_agent.cli.controller_choice import controller_and_task
from tdac_agent.cli.sentences import print_plain
from tdac_agent.cli.shared_options import NoiseFlags
from tdac_agent.cli.task_flags import TaskFlags
from tdac_agent.cli.verify_options import VerifyOptions
from tdac_agent.option_fields import flag_name, typed_fields
from tdac_agent.ros2.recorded import RecordedReport, compare
from tdac_agent.verification.verify import read_source
from tdac_envs.core.errors import TaskError

_ALLOWED = {"controller", "recorded", "tier", "as_json"}


def run_recorded(flags: TaskFlags, options: VerifyOptions, noise: NoiseFlags) -> int:
    """Compares a bag and prints the result; returns 0 if nothing differs."""
    typed = [each for each in typed_fields(options) if each.name not in _ALLOWED]
    if others := [*typed, *typed_fields(noise)]:
        names = ", ".join(map(flag_name, others))
        raise TaskError(f"--recorded runs no test: leave out {names}")
    if flags.set_name is not None:
        raise TaskError("--recorded is for a task: leave out --set")
    assert options.recorded is not None
    file, task = controller_and_task(options.controller, flags)
    report = compare(options.recorded, read_source(file), task, tier=options.tier)
    if options.as_json:
        print_json({"schema_version": 1, "same": report.passed, **asdict(report)})
    else:
        _show(report, options.recorded, Console())
    return 0 if report.passed else 1


def _show(report: RecordedReport, bag: Path, console: Console) -> None:
    table = Table(show_header=False, title=escape(str(bag)), title_justify="left")
    table.add_row("driven", f"{report.way:.3f} m in {report.seconds:.2f} s")
    table.add_row("commands", f"{report.commands}, {report.same} as the controller's")
    if report.stood:
        table.add_row("stood instead", f"{report.stood} commands of zero")
    table.add_row("others", str(report.different))
    table.add_row("stops on the way", f"{report.stops}, {report.stopped:.2f} s")
    if report.rolled is not None:
        told = f"{report.rolled:.2f} s (dead_man is at least this)"
        table.add_row("from the last command to the stop", told)
    for name, gap in (("map", report.map_gap), ("scans", report.scan_gap)):
        told = "none near" if gap is None else f"{1000 * gap:.1f} mm"
        at = ""
        if name == "map" and report.place is not None:
            at = f" at ({report.place[0]:g}, {report.place[1]:g}) m"
        table.add_row(f"smallest gap, by the {name}", told + at)
    table.add_row("the controller at the end", escape(report.outcome))
    console.print(table)
    for each in report.differences:
        (v, omega), (own, turn) = each.recorded, each.replayed
        print_plain(
            console,
            f"{each.time:.2f} s: recorded {v:.3f} m/s, {omega:.3f} rad/s; the "
            f"controller {own:.3f} m/s, {turn:.3f} rad/s ({each.state})",
        )
    if report.different > len(report.differences):
        print_plain(console, f"and {report.different - len(report.differences)} more")
    if report.passed:
        console.print("[bold cyan]as the controller[/]: no other command")
    elif report.different:
        console.print(f"[bold red]{report.different} other commands[/]")
    else:
        console.print("[bold red]a contact[/], by poses or scans")
