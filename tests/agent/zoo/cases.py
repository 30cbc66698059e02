"""The controllers of the zoo: what is in their files, and what they must come to.

Each kind of task has its own in a folder, `good/` and `attacks/`.
Every file starts with comment lines `# key: value` (further lines are indented):

    idea          what the controller tries, in a few words
    profile       `policy` or `paper`
    verdict       `failed` (attacks) or `passed` (good ones), where it is not the usual
    fails         tests that must fail, without their file; `only` first: no others may
    error         pattern that the failures' messages must match
    error TIER    the same, on one tier
    harm TIER     what is harmed on a tier that does not prevent it
    why           which rule or wall stops it
    tiers         `best` (default), or `every` one that works here
    onto          file that the source is appended to, of its kind of task or of all
    also          further kinds of task it is judged in
    repeat        `N TEXT`: the source ends with so many repetitions of a text
    hides         pattern that the feedback must not match
    seed          `of the installation`, where it is not 0
    limits        `name=value` of the sandbox, where not the zoo's or the usual ones

`@SECRET@`, `@TARGET@`, `@PACKAGE@`, `@TCP@`, `@UDP@`, `@UNIX@` and `@STATE@` in a
source stand for a secret file, a folder to write to, the installed package, two ports,
a socket file, and the secret of the installation.
"""

from __future__ import annotations

import functools
import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from grounds import KINDS

from tdac_agent.sandbox import available_tiers

ZOO = Path(__file__).parent


@dataclass(frozen=True, slots=True)
class Case:
    """One controller and what is expected of it."""

    name: str
    kind: str
    body: bytes
    header: dict[str, str]
    good: bool

    def __str__(self) -> str:
        return f"{self.kind}/{'good' if self.good else 'attacks'}/{self.name}"

    @property
    def passes(self) -> bool:
        return self.header.get("verdict", "passed" if self.good else "failed") == (
            "passed"
        )

    @property
    def every_tier(self) -> bool:
        return self.header.get("tiers", "best") == "every"

    def expected(self, key: str, tier: str) -> str:
        """A header's value on one tier."""
        return self.header.get(f"{key} {tier}", self.header.get(key, ""))


@functools.cache
def all_cases() -> list[Case]:
    """Every controller in each kind of task it is judged in, good ones first."""
    folders = [(kind, folder) for folder in ("good", "attacks") for kind in KINDS]
    return [
        case
        for kind, folder in folders
        for path in sorted((ZOO / kind / folder).glob("*.py"))
        for case in _cases_of(path, kind)
    ]


def _cases_of(path: Path, kind: str) -> Iterator[Case]:
    case = load_case(path, kind)
    yield case
    for other in case.header.get("also", "").split():
        yield load_case(path, other)


def load_case(path: Path, kind: str) -> Case:
    """Reads a controller of the zoo, for a kind of task."""
    body = path.read_bytes()
    header: dict[str, str] = {}
    key = ""
    for line in body.decode("utf-8", "replace").splitlines():
        named = re.match(r"# ([a-z]+(?: [a-z]+)?): (.*)", line)
        if named:
            key = named[1]
            header[key] = named[2].strip()
        elif key and line.startswith("#   "):
            header[key] += f" {line[1:].strip()}"
        else:
            break
    if onto := header.get("onto"):
        own, shared = ZOO / kind / onto, ZOO / onto
        base = own if own.exists() else shared
        body = base.read_bytes() + b"\n\n" + body
    if repeat := header.get("repeat"):
        count, _, text = repeat.partition(" ")
        body = body.rstrip(b"\n") + int(count) * text.encode()
    return Case(path.stem, kind, body, header, path.parent.name == "good")


def tiers_of(case: Case) -> list[str]:
    """Tiers on which a case is judged here."""
    return working_tiers() if case.every_tier else working_tiers()[:1]


@functools.cache
def working_tiers() -> list[str]:
    """Names of the tiers that work here, best first."""
    return [status.tier.name for status in available_tiers() if status.works]
