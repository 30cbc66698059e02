"""Controller templates with tunable parameters."""

from __future__ import annotations

from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any, Generic

import jinja2

from tdac_agent.builtin.parameters import P


@dataclass(frozen=True, slots=True)
class Template(Generic[P]):
    """A controller template.

    Attributes:
        kind: Class of the parameters, with neutral defaults.
        file: Jinja2 template of the source.
        facts: Template variables besides the parameters.
    """

    kind: type[P]
    file: Path
    facts: dict[str, Any]

    def render(self, parameters: P) -> str:
        """Returns the source of the controller with these parameters."""
        template = jinja2.Environment(
            undefined=jinja2.StrictUndefined, keep_trailing_newline=True
        ).from_string(self.file.read_text(encoding="utf-8"))  # raw read: shipped
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
