"""What is made next, what is counted, and when a campaign stops."""

import pytest

from tdac_agent.campaign.config import CampaignError
from tdac_agent.campaign.drive import campaign_folder, run_all
from tdac_agent.campaign.perform import Outcome, Terms, work_of
from tdac_agent.campaign.plan import WHOLE, Cell, Plan
from tdac_agent.campaign.progress import CampaignProgress
from tdac_agent.errors import RunError
from tdac_agent.executors.executor import MOST_DEATHS, Died, Ended, RetryQueue, Started

TERMS = Terms("none", 1, None, None, "all")


def plan_of(*learners, runs=3):
    """A plan of which nothing but the names matters."""
    common = ("dual tier", "full", 20, 1, True, None, 100)
    cells = [Cell(name, "maze", "maze", name, name, *common) for name in learners]
    return Plan(tuple(cells), {}, {}, runs, 0)


def carried_out(plan, come_of):
    """The progress, and the names of the runs in the order in which they were made.

    Args:
        plan: Whose runs are made, one after the other.
        come_of: Gives a run's status by its name and how often it was begun.
    """
    made = []

    def run(work, next_run):
        while (planned := next_run()) is not None:
            made.append(planned.name)
            yield Started(planned)
            status, reason = come_of(planned.name, made.count(planned.name))
            outcome = Outcome(planned.name, status, reason, tokens=10, cost=0.5)
            yield Ended(planned, outcome)

    progress = CampaignProgress.of(plan, WHOLE)
    run_all(progress, list(plan.all()), TERMS, run, lambda update: None)
    return progress, made


def test_a_fault_is_tried_once_more_after_all_others():
    """Its first ending is forgotten; tokens and money are counted once."""

    def come_of(name, times):
        ill = name == "builtin/r0001" and times == 1
        return ("fault", f"{name}: down") if ill else ("verified", "")

    progress, made = carried_out(plan_of("builtin"), come_of)
    assert made == [f"builtin/r000{n}" for n in (1, 2, 3, 1)]
    assert (progress.finished, progress.now, progress.planned) == (3, 3, 3)
    assert not +progress.problems
    assert (progress.tokens, progress.cost) == (30, 1.5)


def test_what_always_fails_is_told_once_with_how_often():
    """Reasons that differ by the run's name alone are one; no run is tried for ever."""

    def come_of(name, times):
        return "fault", f"cannot reach {name}"

    progress, made = carried_out(plan_of("builtin"), come_of)
    assert len(made) == 6
    assert progress.problems == {"fault: cannot reach RUN": 3}
    assert (progress.finished, progress.tallies["builtin"].halted) == (0, 3)


def test_an_exhausted_budget_stops_what_may_cost_and_nothing_else():
    """The free runs go on; those that were not begun are left, not failed."""

    def come_of(name, times):
        return ("verified", "") if "builtin" in name else ("budget", "spent")

    progress, made = carried_out(plan_of("openai:x", "builtin"), come_of)
    assert made == ["openai:x/r0001", *(f"builtin/r000{n}" for n in (1, 2, 3))]
    assert progress.exhausted
    assert progress.tallies["openai:x"].ended == {"budget": 1}


def test_a_run_whose_processes_die_is_given_up_at_last():
    """It comes before all others, and is told after so many deaths."""
    runs = list(plan_of("builtin").all())
    bereaved = RetryQueue(work_of(TERMS), iter(runs[1:]).__next__)
    for _ in range(MOST_DEATHS - 1):
        assert bereaved.died(runs[0], "why") == Died(runs[0], "why")
        assert bereaved.next() == runs[0]
    ended = bereaved.died(runs[0], "out of memory")
    assert isinstance(ended, Ended)
    assert ended.outcome.status == "error"
    assert ended.outcome.reason.endswith("last reason: out of memory")
    assert bereaved.next() == runs[1]


def test_a_second_driver_is_refused_and_a_shard_of_its_own_is_not(tmp_path):
    out = tmp_path / "out"
    with campaign_folder(out, WHOLE, "name: x"):
        with (
            pytest.raises(RunError, match="another process is at work"),
            campaign_folder(out, WHOLE, "name: x"),
        ):
            pass
        with campaign_folder(out, type(WHOLE)(1, 2), "name: x"):
            pass


def test_a_folder_with_other_things_is_not_used(tmp_path):
    (tmp_path / "thesis.tex").write_text("")
    with (
        pytest.raises(CampaignError, match="is not empty; give another"),
        campaign_folder(tmp_path, WHOLE, ""),
    ):
        pass
    assert [path.name for path in tmp_path.iterdir()] == ["thesis.tex"]
