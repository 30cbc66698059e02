"""Flags of robust verification, and of the replay of one of its episodes."""

from __future__ import annotations

from dataclasses import asdict, dataclass, fields

from tdac_agent.cli.flags import as_word, flag
from tdac_agent.tasks.disturbance import Disturbance
from tdac_agent.verification.judge.sequential import MARGIN, SequentialTest
from tdac_envs.core.errors import TaskError


@dataclass(frozen=True, slots=True)
class DisturbanceFlags:
    """How much to disturb; None where a flag is not given."""

    range_noise: float | None = None
    wheel_slip: float | None = None
    motor_lag: float | None = None
    delay: int | None = None

    def given(self) -> dict[str, float]:
        """Those that are given, by field."""
        return {name: v for name, v in asdict(self).items() if v is not None}

    def words(self) -> list[str]:
        """The command line that gives the same again."""
        return [
            word
            for name, value in self.given().items()
            for word in (flag(name), as_word(value))
        ]

    def disturbance(self) -> Disturbance:
        """The defaults with what is given.

        Raises:
            TaskError: A value makes no sense.
        """
        return Disturbance(**self.given())  # type: ignore[arg-type]


@dataclass(frozen=True, slots=True)
class RobustFlags:
    """What `--robust` asks for; None where a flag is not given."""

    robust: int | None = None
    first_seed: int | None = None
    accept_at: float | None = None
    margin: float | None = None
    disturbed: DisturbanceFlags = DisturbanceFlags()

    def check(self) -> None:
        """Refuses, before anything is run, what makes no sense.

        Raises:
            TaskError: A flag needs another one, or a value makes no sense.
        """
        own = {f.name for f in fields(self)} - {"robust", "disturbed"}
        given = [name for name in sorted(own) if getattr(self, name) is not None]
        if self.robust is None:
            refuse_without("--robust N", [*given, *self.disturbed.given()])
            return
        if self.accept_at is None:
            refuse_without("--accept-at RATE", [n for n in given if n == "margin"])
        else:
            margin = MARGIN if self.margin is None else self.margin
            SequentialTest(self.accept_at, self.robust, margin)
        self.disturbed.disturbance()


def refuse_without(needed: str, given: list[str]) -> None:
    """Refuses flags that mean nothing without another one.

    Raises:
        TaskError: There are any.
    """
    if given:
        names = ", ".join(map(flag, given))
        raise TaskError(f"{names} needs {needed}")
