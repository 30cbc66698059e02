"""Start a child: fork it, confine it, and check that the confinement holds."""

from __future__ import annotations

import functools
import os
from pathlib import Path
from typing import Any

from tdac_agent.sandbox.errors import ControllerFault, SandboxError
from tdac_agent.sandbox.exposure import exposure, visible_entries
from tdac_agent.sandbox.folder import PrivateFolder
from tdac_agent.sandbox.limits import Limits
from tdac_agent.sandbox.process import Child
from tdac_agent.sandbox.tiers import CONFINING, TIERS, Tier, TierStatus
from tdac_agent.sandbox.zygote import SLOTS, Zygote

# Files that exist nearly everywhere and that no controller may read.
WITNESSES = ("/etc/passwd", "/etc/hostname", "/proc/1/status", "/proc/self/environ")


def start(
    workdir: Path | None = None,
    controller_source: str | bytes | None = None,
    *,
    tier: str = "auto",
    limits: Limits | None = None,
    installed: tuple[str, ...] = (),
) -> Child:
    """Start a child in a sandbox, with numpy loaded and no controller imported yet.

    Args:
        workdir: Folder whose files the controller may read; ignored without a source.
        controller_source: Text of `controller.py`; None to copy it later.
        tier: Name of a tier, or "auto" for the best one that works on this machine.
        limits: Resource limits of the child.
        installed: Folders of installed packages that the controller may import.

    Raises:
        ControllerError: The source is larger than 200 kB.
        SandboxError: The tier does not work on this machine or the child did not start.
    """
    limits = limits or Limits()
    child = start_blank(find_tier(tier), limits, installed)
    try:
        if controller_source is not None:
            child.copy_files(workdir, controller_source)
    except BaseException:
        child.close()
        raise
    return child


def start_blank(tier: Tier, limits: Limits, installed: tuple[str, ...] = ()) -> Child:
    """Start a child without files, from a zygote of its own.

    Raises:
        SandboxError: It did not start, or a promise of the tier does not hold.
    """
    zygote = start_zygote(tier, limits, 1, installed)
    try:
        return fork_child(zygote, tier, limits)
    finally:
        zygote.close()


def start_zygote(
    tier: Tier, limits: Limits, slots: int = SLOTS, installed: tuple[str, ...] = ()
) -> Zygote:
    """Start a zygote, which loads numpy while the caller continues.

    Args:
        tier: Tier of its children.
        limits: Limits of its children's scratch folders.
        slots: Maximum number of children.
        installed: Folders of installed packages that its children may import.

    Raises:
        SandboxError: It cannot be started.
    """
    try:
        return Zygote(tier.name, limits, slots, installed)
    except OSError as error:
        raise SandboxError(f"{tier.name}: cannot start a child: {error}") from error


def fork_child(zygote: Zygote, tier: Tier, limits: Limits) -> Child:
    """Fork a child from a zygote, and confine it.

    Raises:
        SandboxError: It did not start, or a promise of the tier does not hold.
        NoRoomError: The zygote has no free folder for another child.
    """
    child = Child(tier.name, limits, zygote.fork(limits))
    try:
        facts = child.set_up(_setup(tier, limits, zygote, child.folder))
    except ControllerFault as fault:
        printed = child.close().output_head.strip()
        raise SandboxError(f"{tier.name}: {printed or fault}") from None
    except BaseException:
        child.close()
        raise
    broken = [promise for promise in tier.promises if not facts[promise]]
    if broken:
        child.close()
        raise SandboxError(f"{tier.name}: promises not kept: {', '.join(broken)}")
    return child


def available_tiers() -> list[TierStatus]:
    """Return the status of every tier, best first; starts a child in each."""
    return [_status(tier) for tier in TIERS]


@functools.cache
def best_tier() -> Tier:
    """Return the best tier with promises that works on this machine.

    Raises:
        SandboxError: There is none. A tier without promises must be named explicitly.
    """
    reasons = []
    for tier in CONFINING:
        status = _status(tier)
        if status.works:
            return tier
        reasons.append(status.reason)
    raise no_confining_tier_error(reasons)


def no_confining_tier_error(reasons: list[str]) -> SandboxError:
    """Return the error for a machine on which no tier with promises works.

    Args:
        reasons: Why each tier does not work.
    """
    return SandboxError(
        "no sandbox that shields your files and network from a controller works on "
        "this machine; use Linux on x86-64 or aarch64 (apt install bubblewrap may "
        "help), or run a trusted controller unconfined: tdac verify --tier rlimits "
        f"(reasons: {'; '.join(reasons)})"
    )


def _status(tier: Tier) -> TierStatus:
    try:
        start_blank(tier, Limits()).close()
    except SandboxError as error:
        return TierStatus(tier, False, str(error))
    return TierStatus(tier, True, "")


def find_tier(name: str) -> Tier:
    """Return the tier of that name, or the best one for "auto".

    Raises:
        SandboxError: There is none, or none works on this machine.
    """
    if name == "auto":
        return best_tier()
    for tier in TIERS:
        if tier.name == name:
            return tier
    names = ", ".join(tier.name for tier in TIERS)
    raise SandboxError(f"expected a sandbox tier (auto, {names}), got {name!r}")


def _setup(
    tier: Tier, limits: Limits, zygote: Zygote, folder: PrivateFolder
) -> dict[str, Any]:
    seen = exposure()
    # Where mounts mask the hidden folders, no path needs to be left out.
    masked = "hides_names" in tier.promises
    readable, listable = (list(seen.system), []) if masked else visible_entries(seen)
    return {
        "steps": list(tier.steps),
        "links": list(seen.links),
        "system": list(seen.system),
        "hidden": list(seen.hidden),
        "packages": [*zygote.installed, *seen.packages],
        "installed": list(zygote.installed),
        "devices": list(seen.devices),
        "readable": readable,
        "listable": listable,
        "root": str(folder.root),
        "site": str(zygote.site),
        "work": str(folder.work),
        "scratch": str(folder.scratch),
        "witnesses": [path for path in WITNESSES if os.access(path, os.R_OK)],
        "foreign": [str(zygote.witness)],
        "cpu_seconds": limits.cpu_seconds,
        "memory_bytes": limits.memory_bytes,
        "frame_bytes": limits.frame_bytes,
        "scratch_bytes": limits.scratch_bytes,
        "open_files": limits.open_files,
    }
