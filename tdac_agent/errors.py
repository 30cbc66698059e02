"""Errors of the agent that a user can act on."""

from __future__ import annotations

from tdac_envs.core.errors import TdacError


class RunError(TdacError):
    """A run folder cannot be read or written."""


class ControllerFileError(TdacError):
    """A controller file cannot be read."""


class ProviderError(TdacError):
    """A model cannot be chosen as it was: unknown, incomplete, no key, no package."""


class Fault(Exception):
    """Neither pass nor fail: the sandbox, the suite or a provider is broken."""
