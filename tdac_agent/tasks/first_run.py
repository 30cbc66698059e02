"""Compilation of the kernels, once per machine: only what is about to be used."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass

from tdac_envs.core.code_cache import cache_folder, has_code


@dataclass(frozen=True, slots=True)
class CodePart:
    """A part of the compiled code that is used, or not, as a whole.

    Attributes:
        use: Calls every kernel of the part through its usual caller.
        package: Package of the kernel that is compiled last.
        last: This kernel, as `module.function`. Once it is cached, so is the part.
        seconds: About how long a core of a current machine compiles.
    """

    use: Callable[[], object]
    package: str
    last: str
    seconds: float

    def is_compiled(self) -> bool:
        """Whether its code for this version and machine is on disk."""
        return has_code(self.package, self.last, cache_folder())


def compile_first(parts: Iterable[CodePart]) -> None:
    """Compiles parts of the code unless they are cached.

    This reports progress; the judge, which would compile most of it in several
    processes at once, would not.
    """
    if cache_folder() is None:
        return
    missing = [part for part in parts if not part.is_compiled()]
    if not missing:
        return
    from tdac_envs.core.compiled import expect

    with expect(sum(part.seconds for part in missing)):
        for part in missing:
            part.use()
