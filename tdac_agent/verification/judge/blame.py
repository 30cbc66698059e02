"""Separates errors of the controller, which are verdicts, from faults of the judge."""

from __future__ import annotations

import traceback
from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path

from tdac_agent.errors import Fault
from tdac_agent.sandbox import ControllerFault, SandboxError
from tdac_agent.sandbox.inner.wire import WireError


@contextmanager
def faults_of_judge() -> Generator[None]:
    """Turns errors that the controller did not cause into a `Fault`.

    Errors of the controller pass through. So do errors about values that cannot be sent
    to the controller, since it may have made them.

    Raises:
        Fault: The sandbox or the judge failed; this says nothing about the controller.
    """
    try:
        yield
    except (ControllerFault, WireError, Fault):
        raise
    except SandboxError as error:
        raise Fault(error.fault) from error
    except Exception as error:
        raise Fault(f"the judge failed: {_in_one_line(error)}") from error


def _in_one_line(error: Exception) -> str:
    """An error and where it was raised, in one line."""
    text = " ".join(traceback.format_exception_only(error)[-1].split())
    frames = traceback.extract_tb(error.__traceback__)
    return f"{text} ({Path(frames[-1].filename).name}:{frames[-1].lineno})"
