"""The cache folder of the machine code: never stale, never written by another user.

numba detects changes only in the file of the kernel itself, and it unpickles what it
finds. So the folder's name has a hash of everything that the machine code depends on,
and `tdac_envs.core.trusted_folders` must confirm that no other user can have written
there.
"""

from __future__ import annotations

import functools
import sys
from importlib.metadata import version
from pathlib import Path

from tdac_envs.core.hashing import sha256_of
from tdac_envs.core.trusted_folders import copy, is_private, is_usable, user_cache

PACKAGE = Path(__file__).parents[1]


def has_code(
    package: str, kernel: str = "kernels.drive", folder: Path | None = None
) -> bool:
    """Whether the compiled code of a kernel is on disk.

    Does not import numba, which is slow.

    Args:
        package: Package of the kernel.
        kernel: Its module and name; by default, that which steps one robot.
        folder: Cache folder. By default, code of any version in any of them counts.
    """
    kept = f"{package.rpartition('.')[2]}_*/{kernel}-*.nbi"
    if folder is not None:
        return any(folder.glob(kept))
    caches = user_cache()
    parents = [PACKAGE / "__pycache__", *([caches / "tdac"] if caches else [])]
    return any(any(parent.glob(f"tdac-*/{kept}")) for parent in parents)


@functools.cache
def cache_folder() -> Path | None:
    """Folder for the machine code of this version on this machine.

    It is beside the byte code or else in the user's cache. None if compilation is
    disabled or, with a warning on stderr, if neither folder is usable.
    """
    from numba import config

    if config.DISABLE_JIT:
        return None
    name = f"tdac-{_key()}"
    beside, caches = PACKAGE / "__pycache__" / name, user_cache()
    if is_usable(beside, mode=0o755):
        return beside
    own = caches / "tdac" / name if caches else None
    # A trusted cache that this user cannot write to is copied to the user's cache.
    if own and not own.exists() and is_private(beside):
        copy(beside, own)
    if own and is_usable(own):
        return own
    places = " or ".join(str(folder.parent) for folder in (beside, own) if folder)
    problem = f"compiled code cannot be kept in {places}: every start compiles again"
    print(f"tdac: {problem}", file=sys.stderr, flush=True)
    return None


def _key() -> str:
    """Hash of what the machine code depends on: sources, versions, machine, settings.

    Only files that import `tdac_envs.core.compiled` define kernels or constants of
    kernels.
    """
    import llvmlite.binding as llvm
    from numba import config

    # raw read: shipped
    texts = (file.read_bytes() for file in sorted(PACKAGE.rglob("*.py")))
    sources = [text for text in texts if b"compiled import" in text]
    settings = {
        name: repr(value)
        for name, value in sorted(vars(config).items())
        if name.isupper() and "THREAD" not in name and name != "CACHE_DIR"
    }
    versions = sys.version, version("numba"), version("llvmlite"), version("numpy")
    features = sorted(llvm.get_host_cpu_features().items())
    platform = repr((versions, llvm.get_host_cpu_name(), features, settings))
    return sha256_of(b"\0".join([platform.encode(), *sources]))[:16]
