"""Read a YAML file into a pydantic model, or refuse it with a one-line message."""

from __future__ import annotations

from pathlib import Path
from typing import TypeVar

from pydantic import BaseModel, ValidationError

from tdac_envs.core.errors import TdacError, first_problem
from tdac_envs.core.intake import TEXT_BYTES, parse_yaml, read_file

M = TypeVar("M", bound=BaseModel)


def read_yaml(file: Path, form: type[M], what: str, refusal: type[TdacError]) -> M:
    """Returns the validated contents of a YAML file.

    Args:
        file: File to read.
        form: Model of its contents.
        what: Words before the file name in messages, such as `the prices in`.
        refusal: Error to raise if it cannot be read or has a wrong or unknown key.
    """
    try:
        return form.model_validate(parse_yaml(read_file(file, TEXT_BYTES)))
    except ValidationError as error:
        raise refusal(f"{file}: {first_problem(error, form)}") from error
    except (OSError, ValueError) as error:
        reason = error.strerror if isinstance(error, OSError) else error
        raise refusal(f"cannot read {what} {file}: {reason}") from error
