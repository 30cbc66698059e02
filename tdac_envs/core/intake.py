"""Reads untrusted files: regular ones of limited size, with sane values.

Every file that another person may have written is read by `read_file`, and its YAML or
JSON by `parse_yaml` or `parse_json`. Whatever the file contains, the only errors are
OSError and ValueError, with a one-line message.
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

from tdac_envs.core.errors import MAX_QUOTED

TEXT_BYTES = 1_000_000
"""Size limit of a file that people write."""
RECORD_BYTES = 32_000_000
"""Size limit of a file of a run, except pictures and arrays."""
IMAGE_BYTES = 512_000_000
"""Size limit of a picture or grid: 64 megapixels of 8 bytes."""

_MOST_NODES = 20_000
_DEEPEST = 64
_INTEGERS = range(-(2**63), 2**63)
_MOST_DIGITS = 100
_MOST_FILES = 10_000
# With other methods, zipfile does not limit the size of what it unpacks at once.
_BOUNDED = (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED)


def read_file(path: str | Path, most: int, offset: int = 0) -> bytes:
    """The bytes of a regular file.

    Never blocks: a pipe or a device is refused as soon as it is open.

    Args:
        path: The file; links are followed.
        most: Maximum number of bytes from `offset` on.
        offset: Index of the first byte to read.

    Raises:
        OSError: The file is missing, not regular or too large; `strerror` says which.
    """
    try:
        handle = os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC | os.O_NOCTTY)
    except OSError as error:
        if error.errno in (errno.ENXIO, errno.ENODEV):  # a socket, or no such device
            raise _refused(errno.EINVAL, "not a regular file", path) from None
        raise
    except ValueError:  # a null character, or a lone surrogate
        raise _refused(errno.EINVAL, "not a valid file name", path) from None
    try:
        status = os.fstat(handle)
        mode = status.st_mode
        if stat.S_ISDIR(mode):
            raise _refused(errno.EISDIR, os.strerror(errno.EISDIR), path)
        if not stat.S_ISREG(mode):
            raise _refused(errno.EINVAL, "not a regular file", path)
        if status.st_size - offset > most:
            raise _too_large(most, path)
        # Some files in /proc are regular, report size 0 and never end.
        with open(handle, "rb", closefd=False) as file:
            file.seek(offset)
            data = file.read(most + 1)
    except OSError as error:
        if error.filename is None:
            raise _refused(error.errno or 0, str(error.strerror), path) from None
        raise
    finally:
        os.close(handle)
    if data is None:  # a read would block, so the file is not really regular
        raise _refused(errno.EINVAL, "not a regular file", path)
    if len(data) > most:
        raise _too_large(most, path)
    return data


def _too_large(most: int, path: str | Path) -> OSError:
    return _refused(errno.EFBIG, f"larger than {most / 1e6:g} MB", path)


def _refused(number: int, why: str, path: str | Path) -> OSError:
    return OSError(number, why, str(path))


def read_array(data: bytes) -> NDArray[Any]:
    """The array in the bytes of a `.npy` file; the size in its header is checked first.

    Raises:
        ValueError: It is not a `.npy` file of numbers, or its size is not as declared.
    """
    content = io.BytesIO(data)
    try:
        if np.lib.format.read_magic(content) == (1, 0):
            header = np.lib.format.read_array_header_1_0(content)
        else:
            header = np.lib.format.read_array_header_2_0(content)
    # The header is a Python literal; parsing it may raise any error.
    except Exception as error:
        raise ValueError(f"not a .npy file: {one_line(error)}") from None
    shape, fortran, dtype = header
    rest = memoryview(data)[content.tell() :]
    if dtype.kind not in "biuf" or math.prod(shape) * dtype.itemsize != len(rest):
        raise ValueError(
            f"expected numbers of shape {shape}, got {len(rest)} bytes of {dtype}"
        )
    flat = np.frombuffer(rest, dtype)
    return flat.reshape(shape, order="F" if fortran else "C")


def read_zip(
    data: bytes, most: int, wanted: Collection[str] | None = None
) -> dict[str, bytes]:
    """The contents of the files in a zip file, by file name.

    The sizes in its directory are checked before anything is unpacked, and no file is
    unpacked beyond its declared size.

    Args:
        data: Bytes of the zip file.
        most: Maximum total size of the wanted files, bytes.
        wanted: Names of the files to read; all by default.

    Raises:
        ValueError: It is not a zip file, is damaged, or a limit is exceeded.
    """
    # Each entry of the zip directory begins with this signature.
    if data.count(b"PK\x01\x02") > _MOST_FILES:
        raise ValueError(f"more than {_MOST_FILES} files in the zip file")
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            items = [
                item
                for item in archive.infolist()
                if wanted is None or item.filename in wanted
            ]
            if any(item.compress_type not in _BOUNDED for item in items):
                raise ValueError("unsupported compression method in the zip file")
            if len({item.filename for item in items}) < len(items):
                raise ValueError("two files of one name in the zip file")
            if sum(item.file_size for item in items) > most:
                raise ValueError(f"more than {most / 1e6:.3g} MB when unpacked")
            return {item.filename: archive.read(item) for item in items}
    except ValueError:
        raise
    # zipfile and zlib raise dozens of error types for a damaged file.
    except Exception as error:
        raise ValueError(f"a damaged zip file: {one_line(error)}") from None


def parse_yaml(text: bytes) -> Any:
    """The value in a YAML text.

    Raises:
        ValueError: It is not YAML, or `check` refuses the value.
    """
    try:
        value = yaml.load(text.decode("utf-8-sig"), _Loader)
    except yaml.MarkedYAMLError as error:
        where = error.problem_mark or error.context_mark
        line = f"line {where.line + 1}: " if where else ""
        problem = one_line(error.problem or error.context)
        raise ValueError(f"not valid YAML: {line}{problem}") from None
    # The constructors of dates, numbers and tags raise dozens of error types.
    except Exception as error:
        raise ValueError(f"not valid YAML: {one_line(error)}") from None
    check(value)
    return value


def parse_json(text: bytes) -> Any:
    """The value in a JSON text.

    Raises:
        ValueError: It is not JSON, or `check` refuses the value.
    """
    try:
        value = json.loads(text.decode("utf-8-sig"))
    except RecursionError:
        raise ValueError(f"nested deeper than {_DEEPEST} levels") from None
    check(value)
    return value


def one_line(error: object) -> str:
    """The message of an error as one line of limited length."""
    return " ".join(str(error).split())[:MAX_QUOTED] or type(error).__name__


def printable(name: str) -> str:
    """A file name of limited length, with `?` for unprintable characters."""
    return "".join(c if c.isprintable() else "?" for c in name[:MAX_QUOTED])


def check(value: Any, *, any_text: bool = False) -> None:
    """Checks all parts of a value from a YAML or JSON file.

    Args:
        value: The parsed value.
        any_text: Whether strings may have lone surrogates, as model replies may.

    Raises:
        ValueError: A number is not finite or has more than 64 bits, a string has a lone
            surrogate, or the value is nested too deeply.
    """
    level: list[Any] = [value]
    for _ in range(_DEEPEST):
        if not level:
            return
        level = [part for whole in level for part in _parts(whole, any_text)]
    raise ValueError(f"nested deeper than {_DEEPEST} levels")


def _parts(value: Any, any_text: bool) -> Iterator[Any]:
    """Yields the parts of a container; raises ValueError for an invalid scalar."""
    if isinstance(value, dict):
        yield from value.keys()
        yield from value.values()
    elif isinstance(value, list | tuple | set):
        yield from value
    elif isinstance(value, float) and not math.isfinite(value):
        raise ValueError(f"{value} is not a finite number")
    elif isinstance(value, int) and value not in _INTEGERS:
        raise ValueError("an integer has more than 64 bits")
    elif isinstance(value, str) and not any_text and not _is_unicode(value):
        raise ValueError("a string has a lone surrogate, which is not a character")


def _is_unicode(text: str) -> bool:
    try:
        text.encode()
    except UnicodeEncodeError:
        return False
    return True


class _Loader(yaml.SafeLoader):
    """Limits the nesting depth and the number of nodes after expanding aliases."""

    def __init__(self, stream: str) -> None:
        super().__init__(stream)
        self._nodes = self._depth = 0
        self._nodes_of: dict[str, int] = {}

    def compose_node(self, parent: Any, index: Any) -> Any:
        event = self.peek_event()  # type: ignore[no-untyped-call]
        if isinstance(event, yaml.AliasEvent):
            # An alias inside its own anchor would expand forever.
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
        # Parsing takes quadratic time in base 60 and base 2.
        if len(self.construct_scalar(node)) > _MOST_DIGITS:
            raise ValueError(f"an integer has more than {_MOST_DIGITS} digits")
        return super().construct_yaml_int(node)

    def _refuse_large(self, event: Any) -> None:
        if self._depth > _DEEPEST:
            problem = f"nested deeper than {_DEEPEST} levels"
        elif self._nodes > _MOST_NODES:
            problem = f"more than {_MOST_NODES} values"
        else:
            return
        raise yaml.MarkedYAMLError(problem=problem, problem_mark=event.start_mark)


_Loader.add_constructor("tag:yaml.org,2002:int", _Loader.construct_yaml_int)
