"""What runs with scripted models write controllers for."""

from dataclasses import dataclass, field


@dataclass
class Subject:
    """What controllers are written for, one that solves it, and further arguments."""

    problem: object
    good: str
    given: dict = field(default_factory=dict)

    @property
    def is_task(self):
        return not self.given
