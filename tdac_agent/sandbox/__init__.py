"""Run an untrusted `controller.py` in a child process and communicate with it.

`start` returns a `Child`. The controller's results come back as plain data, its
failures as `ControllerFault`s, and failures of the sandbox as `SandboxError`.
"""

from tdac_agent.sandbox.ending import ChildUsage
from tdac_agent.sandbox.errors import (
    ControllerDied,
    ControllerError,
    ControllerFault,
    ControllerOutputFlood,
    ControllerOverdrawn,
    ControllerProtocolError,
    ControllerTimeout,
    EnvRefusalError,
    MachineBusyError,
    SandboxError,
)
from tdac_agent.sandbox.exposure import installed_packages
from tdac_agent.sandbox.inner.wire import Handle
from tdac_agent.sandbox.launch import (
    available_tiers,
    best_tier,
    find_tier,
    fork_child,
    no_confining_tier_error,
    start,
    start_zygote,
)
from tdac_agent.sandbox.limits import MAX_SOURCE_BYTES, Limits
from tdac_agent.sandbox.process import Child, EpisodeEnv
from tdac_agent.sandbox.tiers import CONFINING, TIERS, Tier, TierStatus
from tdac_agent.sandbox.waiting import machine_is_to_blame
from tdac_agent.sandbox.zygote import NoRoomError, Zygote

__all__ = [
    "CONFINING",
    "MAX_SOURCE_BYTES",
    "TIERS",
    "Child",
    "ChildUsage",
    "ControllerDied",
    "ControllerError",
    "ControllerFault",
    "ControllerOutputFlood",
    "ControllerOverdrawn",
    "ControllerProtocolError",
    "ControllerTimeout",
    "EnvRefusalError",
    "EpisodeEnv",
    "Handle",
    "Limits",
    "MachineBusyError",
    "NoRoomError",
    "SandboxError",
    "Tier",
    "TierStatus",
    "Zygote",
    "available_tiers",
    "best_tier",
    "find_tier",
    "fork_child",
    "installed_packages",
    "machine_is_to_blame",
    "no_confining_tier_error",
    "start",
    "start_zygote",
]
