"""Files from anybody: only regular ones of a limited size, only values of sane ones.

Every file that may come from somebody else is read by `read_file`; every YAML or JSON
in it by `parse_yaml` or `parse_json`. What they cannot take is an OSError or a
ValueError with one line, whatever is in the file.
"""

from __future__ import annotations

import errno
import io
import json
import math
import os
import stat
import zipfile
from collections.abc import Collection, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from numpy.typing import NDArray

from tdac_envs.core.errors import LONGEST

TEXT_BYTES = 1_000_000
"""Largest file that a person writes."""
RECORD_BYTES = 32_000_000
"""Largest file that this program writes of a run, but for pictures and arrays."""
IMAGE_BYTES = 512_000_000
"""Largest picture or grid: 64 megapixels, 8 bytes each."""

_MOST_NODES = 20_000
_DEEPEST = 64
_INTEGERS = range(-(2**63), 2**63)
_MOST_DIGITS = 100
_MOST_FILES = 10_000
# Others are unpacked as a whole, however little of it is asked for.
_BOUNDED = (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED)


def read_file(path: str | Path, most: int, offset: int = 0) -> bytes:
    """The bytes of a regular file.

    Nothing is waited for: a pipe or a device is refused as soon as it is open.

    Args:
        path: The file; links are followed.
        most: Bytes that it may have.
        offset: Of the first byte that is wanted.

    Raises:
        OSError: There is none, or it is something else, or larger; `strerror` says so.
    """
    try:
        handle = os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC | os.O_NOCTTY)
    except OSError as error:
        if error.errno in (errno.ENXIO, errno.ENODEV):  # a socket, or no such device
            raise _refused(errno.EINVAL, "not a regular file", path) from None
        raise
    except ValueError:  # a null character, or a lone surrogate
        raise _refused(errno.EINVAL, "not the name of a file", path) from None
    try:
        status = os.fstat(handle)
        mode = status.st_mode
        if stat.S_ISDIR(mode):
            raise _refused(errno.EISDIR, os.strerror(errno.EISDIR), path)
        if not stat.S_ISREG(mode):
            raise _refused(errno.EINVAL, "not a regular file", path)
        if status.st_size - offset > most:
            raise _too_large(most, path)
        # Some files of /proc are regular, have no size, and do not end.
        with open(handle, "rb", closefd=False) as file:
            file.seek(offset)
            data = file.read(most + 1)
    except OSError as error:
        if error.filename is None:
            raise _refused(error.errno or 0, str(error.strerror), path) from None
        raise
    finally:
        os.close(handle)
    if data is None:  # nothing yet: it is regular by its name only
        raise _refused(errno.EINVAL, "not a regular file", path)
    if len(data) > most:
        raise _too_large(most, path)
    return data


def _too_large(most: int, path: str | Path) -> OSError:
    return _refused(errno.EFBIG, f"larger than {most / 1e6:g} MB", path)


def _refused(number: int, why: str, path: str | Path) -> OSError:
    return OSError(number, why, str(path))


def read_array(data: bytes) -> NDArray[Any]:
    """The array in the bytes of a `.npy` file; its size is told by its header first.

    Raises:
        ValueError: They are of something else, or of less than the header says.
    """
    content = io.BytesIO(data)
    try:
        if np.lib.format.read_magic(content) == (1, 0):
            header = np.lib.format.read_array_header_1_0(content)
        else:
            header = np.lib.format.read_array_header_2_0(content)
    # The header is a literal of Python, which has errors of its own.
    except Exception as error:
        raise ValueError(f"not a .npy file: {one_line(error)}") from None
    shape, fortran, dtype = header
    rest = memoryview(data)[content.tell() :]
    if dtype.kind not in "biuf" or math.prod(shape) * dtype.itemsize != len(rest):
        raise ValueError(f"expected {shape} numbers, got {len(rest)} bytes of {dtype}")
    flat = np.frombuffer(rest, dtype)
    return flat.reshape(shape, order="F" if fortran else "C")


def read_zip(
    data: bytes, most: int, wanted: Collection[str] | None = None
) -> dict[str, bytes]:
    """The files in a zip file by their names.

    What its directory says of their sizes is added up before anything is unpacked, and
    nothing is unpacked beyond what it says.

    Args:
        data: Of the zip file.
        most: Bytes that those that are wanted may have together.
        wanted: Names of those that are; all of them by default.

    Raises:
        ValueError: It is no zip file, damaged, or holds more.
    """
    # The directory is read as a whole; each file in it has this mark there.
    if data.count(b"PK\x01\x02") > _MOST_FILES:
        raise ValueError(f"a zip file with more than {_MOST_FILES} files in it")
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            there = [
                item
                for item in archive.infolist()
                if wanted is None or item.filename in wanted
            ]
            if any(item.compress_type not in _BOUNDED for item in there):
                raise ValueError("packed by a method that is not used here")
            if sum(item.file_size for item in there) > most:
                raise ValueError(f"more than {most / 1e6:g} MB when unpacked")
            return {item.filename: archive.read(item) for item in there}
    except ValueError:
        raise
    # zipfile and zlib have dozens of errors for a damaged file.
    except Exception as error:
        raise ValueError(f"a damaged zip file: {one_line(error)}") from None


def parse_yaml(text: bytes) -> Any:
    """The value in a YAML text.

    Raises:
        ValueError: It is not YAML, or no value that `check` takes; one line says why.
    """
    try:
        value = yaml.load(text.decode("utf-8-sig"), _Loader)
    except yaml.MarkedYAMLError as error:
        where = error.problem_mark or error.context_mark
        line = f"line {where.line + 1}: " if where else ""
        told = one_line(error.problem or error.context)
        raise ValueError(f"not valid YAML: {line}{told}") from None
    # The constructors of dates, numbers and tags have dozens of errors.
    except Exception as error:
        raise ValueError(f"not valid YAML: {one_line(error)}") from None
    check(value)
    return value


def parse_json(text: bytes) -> Any:
    """The value in a JSON text.

    Raises:
        ValueError: It is not JSON, or no value that `check` takes; one line says why.
    """
    try:
        value = json.loads(text.decode("utf-8-sig"))
    except RecursionError:
        raise ValueError(f"nested deeper than {_DEEPEST} levels") from None
    check(value)
    return value


def one_line(error: object) -> str:
    """What an error says, in a line that is not too long."""
    return " ".join(str(error).split())[:LONGEST] or type(error).__name__


def printable(name: str) -> str:
    """The name of a file with `?` for what cannot be shown, not too long."""
    return "".join(c if c.isprintable() else "?" for c in name[:LONGEST])


def check(value: Any, *, any_text: bool = False) -> None:
    """Refuses what no file of ours has, wherever it is in a value.

    Args:
        value: As YAML or JSON has it.
        any_text: Whether a text may have lone surrogates, as an answer of a model.

    Raises:
        ValueError: A number is not finite or has more than 64 bits, a text has a lone
            surrogate, or it is nested too deeply.
    """
    level: list[Any] = [value]
    for _ in range(_DEEPEST):
        if not level:
            return
        level = [part for whole in level for part in _parts(whole, any_text)]
    raise ValueError(f"nested deeper than {_DEEPEST} levels")


def _parts(value: Any, any_text: bool) -> Iterator[Any]:
    """What a value is made of, unless there is something wrong with it itself."""
    if isinstance(value, dict):
        yield from value.keys()
        yield from value.values()
    elif isinstance(value, list | tuple | set):
        yield from value
    elif isinstance(value, float) and not math.isfinite(value):
        raise ValueError(f"{value} is not a finite number")
    elif isinstance(value, int) and value not in _INTEGERS:
        raise ValueError("a whole number has more than 64 bits")
    elif isinstance(value, str) and not any_text and not _is_unicode(value):
        raise ValueError("a text has half of a surrogate pair, which is no character")


def _is_unicode(text: str) -> bool:
    try:
        text.encode()
    except UnicodeEncodeError:
        return False
    return True


class _Loader(yaml.SafeLoader):
    """Stops at many nodes, which aliases multiply, and at deep ones."""

    def __init__(self, stream: str) -> None:
        super().__init__(stream)
        self._nodes = self._depth = 0
        self._nodes_of: dict[str, int] = {}

    def compose_node(self, parent: Any, index: Any) -> Any:
        event = self.peek_event()  # type: ignore[no-untyped-call]
        if isinstance(event, yaml.AliasEvent):
            # An alias inside its own anchor would never end.
            self._nodes += self._nodes_of.get(str(event.anchor), _MOST_NODES)
            self._refuse_large(event)
            return super().compose_node(parent, index)
        before = self._nodes
        self._nodes, self._depth = self._nodes + 1, self._depth + 1
        self._refuse_large(event)
        node = super().compose_node(parent, index)
        self._depth -= 1
        if event.anchor is not None:
            self._nodes_of[event.anchor] = self._nodes - before
        return node

    def construct_yaml_int(self, node: Any) -> int:
        # One in base 60 or 2 takes the time of its length squared.
        if len(self.construct_scalar(node)) > _MOST_DIGITS:
            raise ValueError(f"a whole number has more than {_MOST_DIGITS} digits")
        return super().construct_yaml_int(node)

    def _refuse_large(self, event: Any) -> None:
        if self._depth > _DEEPEST:
            told = f"nested deeper than {_DEEPEST} levels"
        elif self._nodes > _MOST_NODES:
            told = f"more than {_MOST_NODES} values"
        else:
            return
        raise yaml.MarkedYAMLError(problem=told, problem_mark=event.start_mark)


_Loader.add_constructor("tag:yaml.org,2002:int", _Loader.construct_yaml_int)
