"""Code in the page reads as the file, and is never markup."""

import difflib
import html
import re

from hypothesis import given, settings
from hypothesis import strategies as st

from tdac_agent.html_report.code import count_changes, highlighted, shown_diff

EVIL = "x = '</pre><script>hacked = 1</script>'  # <img src=x onerror=hacked()>\n"
TEXTS = st.text(st.characters(exclude_characters="\r", codec="utf-8"), max_size=200)


def plain(marked):
    """What a browser shows of marked text."""
    return html.unescape(re.sub(r"<[^<>]*>", "", marked))


@settings(deadline=None)
@given(TEXTS)
def test_highlighted_source_is_the_source(source):
    """Whatever it is: Python, half of it, or none at all; line by line."""
    shown = str(highlighted(source))
    assert plain(shown) == source.rstrip("\n")
    for line in shown.split("\n"):
        assert line.count("<span") == line.count("</span>")


def test_keywords_and_strings_have_classes():
    """A theme can colour them."""
    shown = str(highlighted("def f():\n    return 'a'  # b\n"))
    assert '<span class="k">def</span>' in shown
    assert '<span class="c1"># b</span>' in shown
    assert shown.count('<span class="l">') == 2


def test_markup_in_source_is_text():
    """Tags of a controller are shown, not obeyed."""
    for shown in (str(highlighted(EVIL)), str(shown_diff(f"+{EVIL}", 9))):
        tags = set(re.findall(r"</?([a-z]+)", shown))
        assert tags <= {"span", "ins"}
        assert EVIL.strip() in plain(shown)


def test_a_long_file_is_cut():
    """With a word about how much is missing."""
    shown = plain(highlighted("x = 1\n" * 100_000))
    assert shown.endswith("… 400000 more characters")


def test_a_difference():
    """Added and removed lines are told apart; the rest, and the place, are there."""
    before = [f"line {n}\n" for n in range(40)]
    after = [*before[:20], "new <b>\n", *before[21:]]
    diff = "".join(difflib.unified_diff(before, after, "previous", "controller.py"))
    shown = str(shown_diff(diff, 99))
    assert "<del>-line 20</del><ins>+new &lt;b&gt;</ins>" in shown
    assert shown.startswith("<b>@@ -18,7 +18,7 @@</b><span> line 17")
    assert count_changes(diff) == (1, 1)
    assert "previous" not in shown


def test_a_long_difference_is_cut():
    """After so many lines, and within very long ones."""
    shown = str(shown_diff("+x\n" * 5 + f"+{'y' * 10_000}\n", 3))
    assert shown == "<ins>+x\n+x\n+x</ins><em>… 3 more lines</em>"
    assert len(shown_diff(f"+{'y' * 10_000}\n", 3)) < 500
