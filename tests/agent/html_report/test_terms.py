"""Terms are explained where they first stand, in the words of the glossary."""

import re
from pathlib import Path

from tdac_agent.html_report import make_page
from tdac_agent.html_report.terms import PLACE, TERMS, explain_terms
from tdac_agent.runs.replay import DEMO, RULES

GLOSSARY = Path(__file__).parents[3] / "docs" / "glossary.md"
ENTRY = re.compile(r"^### (.+?)\n(.*?)(?=^##|\Z)", re.MULTILINE | re.DOTALL)
LINKS = re.compile(r" ?\((?:\[[^\]]*\]\([^)]*\)(?:, )?)+\)")


def test_the_list_is_the_glossary():
    """Each entry in its order, without its links and marks."""
    entries = {
        name: re.sub(r"[*`]", "", LINKS.sub("", " ".join(text.split()))).strip()
        for name, text in ENTRY.findall(GLOSSARY.read_text(encoding="utf-8"))
    }
    assert len(entries) > 25
    assert list(entries.items()) == list(TERMS.items())


def test_a_term_is_explained_once():
    """The first time, in any case, also in the plural; not in what can be pressed."""
    page = explain_terms(
        "<title>split</title><h1>split</h1><script>split</script><a href='#'>split</a>"
        "<pre>split</pre><p class='split'>Splits, split and resplit</p><b>split</b>"
    )
    mark = f'<abbr title="{TERMS["split"].replace("&", "&amp;")}">Splits</abbr>'
    assert page.count("<abbr") == 1
    assert f"<p class='split'>{mark}, split and resplit</p>" in page


def test_short_terms_have_their_case():
    page = explain_terms("<p>K, Ot, J; CS(K); then k &lt; j, OT</p>")
    found = re.findall(r"<abbr[^>]*>(.*?)</abbr>", page)
    assert found == ["CS(K)", "k", "j", "OT"]


def test_a_long_term_is_not_a_short_one():
    """`Task set` is no task."""
    page = explain_terms("<p>On a task set, a task.</p>")
    found = re.findall(r"<abbr[^>]*>(.*?)</abbr>", page)
    assert found == ["task set", "task"]


def test_the_terms_of_a_page_are_listed():
    """In the order of the glossary, and no others."""
    page = explain_terms(f"<p>A salt of a split.</p>{PLACE}")
    assert re.findall(r"<dt>(.*?)</dt>", page) == ["split", "salt"]
    assert explain_terms(f"<p>None.</p>{PLACE}") == "<p>None.</p>"


def test_a_report_explains_its_terms():
    html = make_page(DEMO).html.decode()
    found = re.findall(r"<abbr[^>]*>(.*?)</abbr>", html)
    assert len(found) == len(set(map(str.lower, found)))
    assert {"candidate", "episode", "k"} <= {each.lower().rstrip("s") for each in found}
    listed = re.findall(r"<dt>(.*?)</dt>", html.partition("Terms on this page")[2])
    assert len(listed) == len(found)


def test_green_is_for_verified_alone():
    """A candidate of the timeline that only passed has another colour."""
    verified, passed = (make_page(run).html.decode() for run in (DEMO, RULES))
    assert 'class="cell verified"' in verified
    assert 'class="cell passed"' in passed
    assert 'class="cell verified"' not in passed
