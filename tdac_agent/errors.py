"""Errors of the agent that a user can act on."""

from __future__ import annotations

from tdac_envs.errors import TdacError


class RunError(TdacError):
    """A run folder cannot be read or written."""


class ControllerFileError(TdacError):
    """A controller file cannot be read."""


class Fault(Exception):
    """Neither pass nor fail: the sandbox, the suite or a provider is broken."""
