"""The smallest deviation with which a candidate fails, for models to read."""

from __future__ import annotations

from dataclasses import dataclass

from tdac_agent.falsify.falsify import SearchPlan, falsify
from tdac_agent.prompting.feedback import cut
from tdac_agent.runs.falsification import (
    RECORD_FILE,
    Falsification,
    read_falsification,
)
from tdac_agent.runs.falsify_text import failure_text, survived_text
from tdac_agent.synthesis.candidates import Candidate
from tdac_agent.synthesis.terms import Terms
from tdac_agent.tasks.task import Task
from tdac_agent.verification.judge.policy_spec import PolicySpec
from tdac_envs.ladder.task_sets import TaskSet

WORLDS = 2
"""Most worlds of a set that share the episodes of a search."""
FOR_TWO = 64
"""Episodes of each of two worlds: enough for each part alone, and for some together."""
MOST_CHARS = 1200
FOLDER = "envelope"


@dataclass(frozen=True, slots=True)
class _Program:
    """See `Searched`."""

    name: str
    policy: PolicySpec
    sha256: str
    source: bytes
    weights: bytes | None = None


def counterexample_text(
    candidate: Candidate, problem: Task | TaskSet, terms: Terms, first: int
) -> str:
    """What a candidate survives, and the smallest failure that a search found.

    Where and how it fails is told in the frame that a controller observes.

    Args:
        candidate: A candidate that drove in the pool.
        problem: The task, or the task set, whose split `dev` is searched: worlds of the
            pool that the candidate passed.
        terms: What the trials share; its options say how many episodes are searched.
        first: Number of the first episode of the pool; in texts, it is 1.

    Returns:
        Lines; empty without a search, or without a world to search.
    """
    episodes = terms.options.envelope
    chosen: tuple[int, ...] = ()
    if episodes and isinstance(problem, TaskSet):
        most = min(WORLDS, max(1, episodes // FOR_TWO))
        chosen = tuple(row.number for row in candidate.pool if row.success)[:most]
    if not episodes or (isinstance(problem, TaskSet) and not chosen):
        return ""
    plan = SearchPlan(episodes=episodes, chosen=chosen)
    return cut(_told(searched(candidate, problem, plan, terms), first), MOST_CHARS)


def searched(
    candidate: Candidate, problem: Task | TaskSet, plan: SearchPlan, terms: Terms
) -> Falsification:
    """A search for the failures of a candidate; one on record is not made again.

    Args:
        candidate: The candidate.
        problem: Where it drives.
        plan: What is searched; a search with more episodes serves as well.
        terms: What the trials of the run share.

    Raises:
        Fault: The sandbox is broken.
    """
    out, recorder = candidate.folder / FOLDER, terms.recorder
    if recorder.vouches(out / RECORD_FILE):
        kept = read_falsification(out)
        same = kept is not None and kept.policy_sha256 == candidate.sha256
        if same and kept is not None and kept.budget >= plan.episodes:
            return kept
    about = {"k": candidate.k, "j": candidate.j, "episodes": plan.episodes}
    recorder.tell({"event": "envelope.start", **about})
    raw, spec = candidate.raw, PolicySpec("controller")
    program = _Program(candidate.name, spec, candidate.sha256, raw)
    found = falsify(program, problem, plan, tier=terms.tier, out=out, judge=terms.judge)
    recorder.vouch(out / RECORD_FILE)
    return found


def _told(found: Falsification, first: int) -> str:
    """The search in lines."""
    if found.fails_plainly and not any(each.directions for each in found.envelopes):
        return ""
    lines = [f"- {survived_text(found)}"]
    failed = found.counterexample
    if failed is None:
        lines.append(f"- no failure was found in {found.episodes} episodes")
    else:
        where = "" if found.split is None else f" in world {failed.number - first + 1}"
        lines.append(f"- smallest failure found{where}: {failure_text(failed, found)}")
    return "\n".join(lines)
