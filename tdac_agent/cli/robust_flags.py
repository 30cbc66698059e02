"""Flags of robust verification and of playing one of its episodes."""

from __future__ import annotations

from dataclasses import asdict, dataclass, fields

from tdac_agent.cli.flags import as_word, flag
from tdac_agent.tasks.disturbance import Disturbance
from tdac_agent.verification.judge.sequential import MARGIN, SequentialTest
from tdac_envs.core.errors import TaskError


@dataclass(frozen=True, slots=True)
class DisturbanceFlags:
    """Sizes of the disturbances; None for a flag that is not given."""

    range_noise: float | None = None
    wheel_slip: float | None = None
    motor_lag: float | None = None
    delay: int | None = None
    wheel_gains: float | None = None
    axle_error: float | None = None
    range_dropout: float | None = None

    def given(self) -> dict[str, float]:
        """The values of the given flags by field."""
        return {name: v for name, v in asdict(self).items() if v is not None}

    def words(self) -> list[str]:
        """The command line words that repeat these flags."""
        return [
            word
            for name, value in self.given().items()
            for word in (flag(name), as_word(value))
        ]

    def disturbance(self) -> Disturbance:
        """The disturbance: the given values, defaults for the others.

        Raises:
            TaskError: A value is out of range.
        """
        return Disturbance(**self.given())  # type: ignore[arg-type]


@dataclass(frozen=True, slots=True)
class RobustFlags:
    """The flags of robust verification; None for a flag that is not given."""

    robust: int | None = None
    first_seed: int | None = None
    accept_at: float | None = None
    margin: float | None = None
    disturbed: DisturbanceFlags = DisturbanceFlags()

    def check(self) -> None:
        """Checks the flags before anything is run.

        Raises:
            TaskError: A flag needs another one, or a value is out of range.
        """
        own = {f.name for f in fields(self)} - {"robust", "disturbed"}
        given = [name for name in sorted(own) if getattr(self, name) is not None]
        if self.robust is None:
            require_flag("--robust N", [*given, *self.disturbed.given()])
            return
        if self.accept_at is None:
            require_flag("--accept-at RATE", [n for n in given if n == "margin"])
        else:
            margin = MARGIN if self.margin is None else self.margin
            SequentialTest(self.accept_at, self.robust, margin)
        self.disturbed.disturbance()


def require_flag(needed: str, given: list[str]) -> None:
    """Refuses flags that have no effect without another one.

    Raises:
        TaskError: There are such flags.
    """
    if given:
        names = ", ".join(map(flag, given))
        raise TaskError(f"{names} need{'s' if len(given) == 1 else ''} {needed}")
