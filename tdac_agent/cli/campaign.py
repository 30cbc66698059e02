"""`tdac campaign`: a live table, then the metrics and the unfinished runs."""

from __future__ import annotations

import os
import shlex
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path
from typing import Any

from rich.markup import escape

from tdac_agent.campaign.config import CampaignConfig
from tdac_agent.campaign.drive import (
    campaign_folder,
    foreign_runs,
    read_progress,
    run_all,
    unplanned_folders,
)
from tdac_agent.campaign.perform import Terms
from tdac_agent.campaign.plan import (
    Plan,
    PlannedRun,
    Shard,
    make_plan,
    models_of,
    setting_of,
)
from tdac_agent.campaign.progress import CampaignProgress
from tdac_agent.cli.campaign_dry_run import dry_run, read_campaign
from tdac_agent.cli.campaign_flags import CampaignOptions
from tdac_agent.cli.campaign_live import LiveView
from tdac_agent.cli.campaign_table import make_console, progress_line
from tdac_agent.cli.console import Console, print_json
from tdac_agent.cli.sentences import print_plain, print_sentences
from tdac_agent.executors.local import executor_of
from tdac_agent.models.choice import choose_models
from tdac_agent.models.lifecycle import model_warnings
from tdac_agent.models.provider import Provider
from tdac_agent.models.ready import check_ready, check_servers
from tdac_agent.models.tariff import bounds_of, tariffs_of
from tdac_agent.option_fields import words_of
from tdac_envs.core.intake import TEXT_BYTES, read_file


def command_of(options: CampaignOptions) -> str:
    """The command line that continues the campaign."""
    words = words_of(replace(options, as_json=False))
    return shlex.join(["tdac", "campaign", options.config, *words])


def run(options: CampaignOptions) -> int:
    """Runs a campaign and prints its progress and results; returns the exit code."""
    if options.dry_run:
        return dry_run(options)
    console, shard = make_console(stderr=options.as_json), Shard.parse(options.shard)
    file, config, folder = read_campaign(options)
    key_over_http = options.key_over_http
    # What has finished needs no model, and a server may need a permission.
    if not folder.exists() and (config.base_url is None or options.trust):
        names = ("base_url", "max_cost", "max_tokens")
        known = {name: getattr(config, name) for name in names}
        check_ready(config.models, {**known, "key_over_http": key_over_http})
    with console.status("reading the tasks …"):
        plan = make_plan(config, file.parent, trust=options.trust)
    with campaign_folder(folder, shard, read_file(file, TEXT_BYTES).decode("utf-8")):
        terms = Terms(
            folder=str(folder.resolve()),
            workers=options.workers or len(os.sched_getaffinity(0)),
            max_cost=config.max_cost,
            max_tokens=config.max_tokens,
            keep=config.keep,
            key_over_http=key_over_http,
        )
        progress, remaining = read_progress(plan, shard, terms.runs)
        check_models(plan, remaining, config, key_over_http=key_over_http)
        _print_heading(console, config, progress, folder)
        _print_notes(console, plan, terms)
        try:
            if remaining:
                _run_remaining(progress, remaining, terms, options.executor, console)
        finally:
            # Imported late: pandas and scipy take seconds to load.
            from tdac_agent.campaign.collect import collect, write_tables
            from tdac_agent.campaign.figures import write_figures
            from tdac_agent.cli.campaign_summary import show_set_summary, show_summary

            tables = collect(plan, terms.runs)
            written = write_tables(tables, plan, folder)
            show_summary(tables.summary, console)
            show_set_summary(tables.set_summary, console)
            figures = write_figures(tables, folder)
            _print_ending(console, progress, folder, options, written, figures)
    if options.as_json:
        print_json(_as_json(progress, folder))
    return _exit_code(progress)


def check_models(
    plan: Plan,
    remaining: Iterable[PlannedRun],
    config: CampaignConfig,
    *,
    key_over_http: bool = False,
) -> None:
    """Creates each model once, so that a missing key is reported before the first run.

    Raises:
        ProviderError: A model cannot be used; the message lists all that is missing.
        Fault: A server does not answer.
    """
    models: list[Provider] = []
    for cell in dict.fromkeys(planned.cell for planned in remaining):
        models += choose_models(
            cell.learner,
            cell.optimizer,
            setting_of(plan.problem(cell)),
            cell.base_url,
            key_over_http=key_over_http,
        )
    bounds_of(models, tariffs_of(models), config.max_cost, config.max_tokens)
    check_servers(models)


def _run_remaining(
    progress: CampaignProgress,
    remaining: list[PlannedRun],
    terms: Terms,
    executor: str,
    console: Console,
) -> None:
    with LiveView(console, progress) as view:
        run_all(progress, remaining, terms, executor_of(executor), view.saw)


def _print_heading(
    console: Console, config: CampaignConfig, progress: CampaignProgress, folder: Path
) -> None:
    kinds = len(progress.tallies)
    console.print(
        f"campaign [bold]{escape(config.name)}[/]: {progress.planned} runs of {kinds} "
        f"kind{'' if kinds == 1 else 's'}, R = {config.runs}; {escape(str(folder))}",
        soft_wrap=True,
    )
    if progress.before == progress.planned:
        console.print("all runs have already finished; nothing was done")
    elif progress.before:
        console.print(f"continuing: {progress.before} have already finished")


def _print_notes(console: Console, plan: Plan, terms: Terms) -> None:
    for line in model_warnings(models_of(plan.cells)):
        print_sentences(console, f"note: {line}", "yellow")
    others = unplanned_folders(plan, terms.runs)
    if others:
        kinds = f"{len(others)} other kind{'' if len(others) == 1 else 's'} of run"
        note = f"ignoring {kinds} in {terms.runs}: of an earlier file, task, suite or"
        print_sentences(console, f"note: {note} version", "yellow")
    foreign = foreign_runs(plan, terms.runs)
    if foreign:
        these = "1 finished run" if foreign == 1 else f"{foreign} finished runs"
        note = f"{these} in {terms.runs} did not end here or changed since: counted as"
        print_sentences(console, f"note: {note} their files claim", "yellow")


def _print_ending(
    console: Console,
    progress: CampaignProgress,
    folder: Path,
    options: CampaignOptions,
    tables: list[Path],
    figures: list[Path],
) -> None:
    for problem, count in progress.problems.most_common():
        print_sentences(console, f"{count} × {problem}", "yellow")
    console.print(progress_line(progress), soft_wrap=True)
    for word, paths in (("tables", tables), ("figures", figures)):
        if paths:
            names = ", ".join(path.name for path in paths)
            print_plain(console, f"  {word} in {folder}: {names}")
    report = shlex.join(["tdac", "report", str(folder)])
    print_plain(console, f"  HTML report: {report}")
    if progress.finished < progress.planned:
        more = " with a higher --max-cost" if progress.exhausted else ""
        print_plain(console, f"  to continue{more}: {command_of(options)}")


def _as_json(progress: CampaignProgress, folder: Path) -> dict[str, Any]:
    return {
        "folder": str(folder),
        "planned": progress.planned,
        "finished": progress.finished,
        "before": progress.before,
        "deaths": progress.deaths,
        "problems": dict(progress.problems),
        "cost": progress.cost,
        "tokens": progress.tokens,
        "seconds": round(progress.seconds, 3),
        "kinds": [
            {"kind": name, "planned": tally.planned, **tally.ended}
            for name, tally in progress.tallies.items()
        ],
    }


def _exit_code(progress: CampaignProgress) -> int:
    if progress.finished == progress.planned:
        return 0
    return 4 if progress.exhausted else 3
