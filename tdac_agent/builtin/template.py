"""A parametrised controller, filled in."""

from __future__ import annotations

from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any, Generic

import jinja2

from tdac_agent.builtin.parameters import P


@dataclass(frozen=True, slots=True)
class Template(Generic[P]):
    """A controller with tuning constants.

    Attributes:
        kind: Class of the parameters; its defaults are the first values.
        file: Jinja2 template of the source.
        facts: Names and values that the template needs beside the parameters.
    """

    kind: type[P]
    file: Path
    facts: dict[str, Any]

    def render(self, parameters: P) -> str:
        """Source of the controller with these parameters."""
        template = jinja2.Environment(
            undefined=jinja2.StrictUndefined, keep_trailing_newline=True
        ).from_string(self.file.read_text(encoding="utf-8"))
        tuning = [
            {
                "constant": item.name.upper(),
                "value": float(getattr(parameters, item.name)),
                "meaning": ", ".join(
                    part
                    for part in (item.metadata["unit"], item.metadata["meaning"])
                    if part
                ),
            }
            for item in fields(parameters)
        ]
        return str(template.render(fields=tuning, **self.facts))
