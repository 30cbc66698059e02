"""Where machine code is kept, so that what is loaded is what would be compiled now.

numba looks for changes in the file of a kernel alone, and it unpickles what it finds.
So the folder is named by everything that the code follows from, and it is used only
where `tdac_envs.core.private` says that nobody else can have written there.
"""

from __future__ import annotations

import functools
import hashlib
import sys
from importlib.metadata import version
from pathlib import Path

from tdac_envs.core.private import copy, is_private, is_usable, user_cache

HERE = Path(__file__).parents[1]


def has_code(package: str) -> bool:
    """Whether the steps of an environment lie compiled on the disk, of some version.

    It does not import numba, which takes a while.

    Args:
        package: Whose module `kernels` has them.
    """
    caches = user_cache()
    parents = [HERE / "__pycache__", *([caches / "tdac"] if caches else [])]
    kept = f"tdac-*/{package.rpartition('.')[2]}_*/kernels.drive-*.nbi"
    return any(any(parent.glob(kept)) for parent in parents)


@functools.cache
def cache_folder() -> Path | None:
    """Where the machine code of this version, on this machine, is kept.

    Beside the byte code, else in the user's own cache. None where nothing is compiled,
    and, said once, where there is no folder that nobody else can write to.
    """
    from numba import config

    if config.DISABLE_JIT:
        return None
    name = f"tdac-{_key()}"
    beside, caches = HERE / "__pycache__" / name, user_cache()
    if is_usable(beside, mode=0o755):
        return beside
    own = caches / "tdac" / name if caches else None
    # What is warm and cannot be added to is copied to a place of one's own.
    if own and not own.exists() and is_private(beside):
        copy(beside, own)
    if own and is_usable(own):
        return own
    places = " or ".join(str(folder.parent) for folder in (beside, own) if folder)
    told = f"compiled code cannot be kept in {places}: each start compiles anew"
    print(f"tdac: {told}", file=sys.stderr, flush=True)
    return None


def _key() -> str:
    """A hash of what machine code follows from: sources, versions, machine, settings.

    A file that imports `tdac_envs.core.compiled` may have a kernel, or a constant of
    one.
    """
    import llvmlite.binding as llvm
    from numba import config

    texts = (file.read_bytes() for file in sorted(HERE.rglob("*.py")))
    sources = [text for text in texts if b"compiled import" in text]
    settings = {
        name: repr(value)
        for name, value in sorted(vars(config).items())
        if name.isupper() and "THREAD" not in name and name != "CACHE_DIR"
    }
    versions = sys.version, version("numba"), version("llvmlite"), version("numpy")
    features = sorted(llvm.get_host_cpu_features().items())
    made_by = repr((versions, llvm.get_host_cpu_name(), features, settings))
    return hashlib.sha256(b"\0".join([made_by.encode(), *sources])).hexdigest()[:16]
