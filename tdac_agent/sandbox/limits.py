"""Resource limits of a controller."""

from __future__ import annotations

from dataclasses import dataclass, fields

MAX_SOURCE_BYTES = 200_000


@dataclass(frozen=True, slots=True)
class Limits:
    """Resource limits of one child.

    A controller may compute and sleep, together, for each of the times in seconds. Time
    in which it waits for a CPU does not count, so that a busy machine does not decide a
    verdict. After five minutes of waiting the sandbox has failed, and there is no
    verdict.

    Attributes:
        start_seconds: Until the child is ready; no controller code runs yet.
        import_seconds: To import the controller.
        reset_seconds: For one `reset`.
        call_seconds: For one call, `policy` included.
        cpu_seconds: CPU time of the child in total.
        memory_bytes: Size of the address space.
        output_bytes: Size of the printed output.
        frame_bytes: Size of one encoded value.
        scratch_bytes: Size of the scratch folder; without a tmpfs, of each file in it.
        open_files: Number of open descriptors.
    """

    start_seconds: float = 30.0
    import_seconds: float = 10.0
    reset_seconds: float = 5.0
    call_seconds: float = 10.0
    cpu_seconds: int = 120
    memory_bytes: int = 4 << 30
    output_bytes: int = 1 << 20
    frame_bytes: int = 32 << 20
    scratch_bytes: int = 64 << 20
    open_files: int = 64

    def __post_init__(self) -> None:
        for field in fields(self):
            value = getattr(self, field.name)
            if not value > 0:
                raise ValueError(f"expected {field.name} above 0, got {value}")
