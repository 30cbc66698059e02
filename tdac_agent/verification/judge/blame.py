"""Whose doing an error is: the controller's, which is a verdict, or ours."""

from __future__ import annotations

import traceback
from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path

from tdac_agent.errors import Fault
from tdac_agent.sandbox import ControllerFault, SandboxError
from tdac_agent.sandbox.inner.wire import WireError


@contextmanager
def ours() -> Generator[None]:
    """Makes a fault of whatever is raised meanwhile and is not the controller's doing.

    Only what a controller did, and values that a test wants to send to it and that
    cannot be sent, are let through: a controller may have made them.

    Raises:
        Fault: Sandbox or judge failed; says nothing about the controller.
    """
    try:
        yield
    except (ControllerFault, WireError, Fault):
        raise
    except SandboxError as error:
        raise Fault(f"the sandbox failed: {error}") from error
    except Exception as error:
        raise Fault(f"the judge failed: {_told(error)}") from error


def _told(error: Exception) -> str:
    """What was raised and where, in one line."""
    text = " ".join(traceback.format_exception_only(error)[-1].split())
    frames = traceback.extract_tb(error.__traceback__)
    return f"{text} ({Path(frames[-1].filename).name}:{frames[-1].lineno})"
