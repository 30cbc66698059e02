"""The permissions that a campaign file needs."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import replace
from pathlib import Path

from tdac_agent.campaign.config import CampaignConfig
from tdac_agent.prompting.prompt import VARIANTS
from tdac_agent.storage.hashes import sha256_of_file
from tdac_agent.storage.shipped import shipped
from tdac_agent.tasks.task import Task
from tdac_agent.tasks.trust import Wish, asking, suite_wish


def required_permissions(
    config: CampaignConfig, base: Path, tasks: Iterable[Task]
) -> Iterator[Wish]:
    """Yields each permission that the user must grant; none for a shipped file.

    Vendors' models need none: `max_cost` or `max_tokens` bounds what they cost.

    Args:
        config: Contents of the campaign file.
        base: Folder of the campaign file.
        tasks: Tasks of the campaign.
    """
    if base.resolve() == shipped("offline.yaml").parent.resolve():
        return
    for name in config.models:
        if name.startswith("command:"):
            yield Wish(asking("model", name))
    if config.base_url is not None:
        yield Wish(f"send its questions, with your key, to {config.base_url}")
    for name in config.prompts:
        if name not in VARIANTS:
            template = base / name
            digest = sha256_of_file(template) if template.is_file() else ""
            yield Wish(f"fill in the template {template}", (), digest)
    for task in tasks:
        if task.suite is not None and not task.trusted:
            yield replace(suite_wish(task.suite), flag=())
