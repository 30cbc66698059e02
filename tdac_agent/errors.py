"""Errors of the agent that a user can act on."""

from __future__ import annotations

from tdac_envs.core.errors import TdacError


class RunError(TdacError):
    """A run folder cannot be read or written."""


class ControllerFileError(TdacError):
    """A controller, policy or output file cannot be read or written."""


class ProviderError(TdacError):
    """A model cannot be used: unknown or incomplete name, missing key or package."""


class Fault(Exception):
    """No verdict is possible: the sandbox, the suite or a provider is broken."""
