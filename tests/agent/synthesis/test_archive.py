"""The archive of a race: who is live, who is the best, who goes on."""

from hypothesis import given
from hypothesis import strategies as st
from pool_drives import archive_of, ranked_member

from tdac_agent.synthesis.archive import Archive, Refused

times = st.lists(st.sampled_from([0.1, 0.2, 0.3, 0.4, 0.5]), min_size=1, max_size=9)


def archive(scores, founders=1):
    return archive_of(
        *(
            ranked_member(k, time, founder=k <= founders)
            for k, time in enumerate(scores, 1)
        )
    )


def ks(members):
    return [each.candidate.k for each in members]


def test_a_child_replaces_its_parent_alone():
    """With a merge, the first one; what is replaced is no longer asked about."""
    found = archive([0.3, 0.5, 0.5, 0.2])
    first, second, third, last = found.members
    assert ks(found.live) == [2, 3, 1, 4]
    found.replace((second, third))
    found.replace((second,))
    found.replace(())
    assert ks(found.replaced) == [2]
    assert ks(found.live) == [3, 1, 4]
    assert ks(found.members) == [1, 2, 3, 4]  # it can still be selected
    assert (found.best(), found.top) == (second, second)
    assert first in found.founders
    assert last not in found.founders


@given(times)
def test_the_best_of_equals_is_the_oldest(scores):
    """Live members are sorted, and equal ones are in their order."""
    found = archive(scores)
    assert found.best().candidate.k == scores.index(max(scores)) + 1
    assert found.top is found.live[0]
    order = [(-each.figures.time, each.candidate.k) for each in found.live]
    assert order == sorted(order)


@given(times, st.integers(0, 4), st.integers(1, 5))
def test_the_best_founder_is_a_finalist(scores, founders, number):
    """With the best others, oldest first, each once."""
    found = archive(scores, founders)
    chosen = [each.k for each in found.finalists(number)]
    known = scores[:founders] or scores[:1]
    base = known.index(max(known)) + 1
    assert found.base.k == base
    assert base in chosen
    assert chosen == sorted(set(chosen))
    assert len(chosen) <= number + 1
    left = [scores[k - 1] for k in range(1, len(scores) + 1) if k not in chosen]
    others = [scores[k - 1] for k in chosen if k != base]
    assert not left or not others or max(left) <= min(others)


def test_nothing_yet():
    """Without a member, there is none to ask about; what was refused is kept apart."""
    found = Archive()
    assert (found.top, found.live, found.founders) == (None, [], [])
    parent, child = ranked_member(1, 0.5), ranked_member(2, 0.4)
    found = archive_of(parent)
    found.refused += [
        Refused(child.candidate, parent, "no"),
        Refused(child.candidate, None, "no"),
    ]
    assert [each.parent for each in found.refused_of(parent)] == [parent]
    found.dropped.append(ranked_member(3, 0.1, parent=parent))
    assert ks(found.children(parent)) == [3]
    assert found.variations == 2
