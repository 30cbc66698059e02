"""A YAML file of a known form, read whole or refused in one line."""

from __future__ import annotations

from pathlib import Path
from typing import TypeVar

from pydantic import BaseModel, ValidationError

from tdac_envs.core.errors import TdacError, first_problem
from tdac_envs.core.intake import TEXT_BYTES, parse_yaml, read_file

M = TypeVar("M", bound=BaseModel)


def read_yaml(file: Path, form: type[M], what: str, refusal: type[TdacError]) -> M:
    """What a file says.

    Args:
        file: To read.
        form: Of its contents.
        what: It holds, for messages: `the prices in`.
        refusal: Raised where it cannot be read, or has a wrong or unknown key.
    """
    try:
        return form.model_validate(parse_yaml(read_file(file, TEXT_BYTES)))
    except ValidationError as error:
        # A key may have another name in a file than in Python.
        known = [field.alias or name for name, field in form.model_fields.items()]
        raise refusal(f"{file}: {first_problem(error, known)}") from error
    except (OSError, ValueError) as error:
        reason = error.strerror if isinstance(error, OSError) else error
        raise refusal(f"cannot read {what} {file}: {reason}") from error
