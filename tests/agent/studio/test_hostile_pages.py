"""A folder of somebody else in the studio: all is shown, nothing of it runs."""

import json
import shutil
from urllib.parse import quote

import pytest

pytest.importorskip("nicegui", reason="needs tdac[studio]")

from selenium.webdriver.common.by import By
from selenium.webdriver.support.ui import WebDriverWait
from studio_process import running_studio

from tdac_agent.html_report.page import make_page, own_script
from tdac_agent.runs.replay import DEMO
from tdac_agent.studio.pages.files import headers_of
from tdac_envs.mapping.bundled import bundled_map

SECONDS = 90
CAME = "globalThis.came=1"
SCRIPT = f"<img src=x onerror='{CAME}'></script><script>{CAME}</script>{{{{{CAME}}}}}"
NAME = f"a' b\"><img src=x onerror={CAME}> {{{{{CAME}}}}}"
MAP = f'm" :alt="{CAME}" onclick="{CAME}.png'
PAGE = f"""<title>x</title><script>
try {{ parent.{CAME} }} catch {{}}
fetch("/alive").then(() => parent.postMessage("answered", "*"))
</script><meta http-equiv="refresh" content="0;url=/alive">"""
JOB = {
    "words": ["bench", SCRIPT, "--set", SCRIPT, "-n", "10"],
    "started": "2026-01-01T00:00:00+00:00",
    "pid": 4_000_000,
    "born": "1",
    "about": NAME,
    "mark": "00",
}


def hostile_run(folder):
    """A run whose texts are all markup."""
    shutil.copytree(DEMO, folder)
    file = folder / "run.json"
    known = json.loads(file.read_text())
    known |= {"task": SCRIPT, "learner": SCRIPT, "optimizer": SCRIPT, "reason": SCRIPT}
    known |= {"status": "budget", "outlook": SCRIPT, "models": [SCRIPT], "tau": None}
    known |= {"clients": [SCRIPT], "version": SCRIPT, "prompt": SCRIPT, "mark": SCRIPT}
    known |= {"enough": {"max_cost": 0.7}, "started": SCRIPT}
    file.write_text(json.dumps(known))
    (folder / "controller.py").write_text(SCRIPT)
    (folder / "task.yaml").write_text(json.dumps({SCRIPT: SCRIPT}))


@pytest.fixture(scope="module")
def studio(tmp_path_factory):
    """One whose folder no other test uses."""
    place = tmp_path_factory.mktemp("hostile") / "place"
    place.mkdir()
    with running_studio(place) as running:
        yield running


@pytest.fixture(scope="module")
def hostile(studio):
    """Its folder, with hostile names and contents."""
    place = studio.place
    hostile_run(place / "runs" / NAME)
    hostile_run(place / "runs" / "two")
    shutil.copy(bundled_map("maze").image, place / MAP)
    for number, words in enumerate((JOB["words"], ["bench"], ["x", "--set"]), 1):
        file = place / ".studio" / "jobs" / f"0000{number}" / "job.json"
        file.parent.mkdir(parents=True)
        about = NAME if number == 1 else f"runs/{number}"
        file.write_text(json.dumps({**JOB, "words": words, "about": about}))
        (file.parent / "output.txt").write_text(f"{SCRIPT}\x1b[2J")
    (place / "b").mkdir()
    for name in ("bench.html", "bench.json"):
        (place / "b" / name).write_text(PAGE)
    return studio


def pages():
    """Addresses, and what each must show."""
    at = quote(f"runs/{NAME}")
    return {
        "runs": ("/runs", NAME),
        "run": (f"/run?at={at}", "this installation did not begin"),
        "no run": (f"/run?at={quote(SCRIPT)}", "There is no run"),
        "benches": ("/benches", NAME),
        "bench": (f"/bench?at={quote(NAME)}", "was not started here"),
        "page of a bench": ("/bench?at=b", "finished"),
        "two runs": (f"/compare?one={at}&other=runs/two", "Settings"),
        "map": (f"/?source={quote(f'map: {MAP}')}", "Click the start"),
        "no map": (f"/?source={quote(f'map: {SCRIPT}')}", "no such file"),
        "worlds": (f"/worlds?level={quote(SCRIPT)}", "Drive it yourself"),
    }


@pytest.mark.slow
@pytest.mark.parametrize("name", pages())
def test_a_page_shows_markup_as_text(name, browser, hostile):
    """No script of the folder, of the address or of a file's name runs."""
    address, says = pages()[name]
    browser.get(hostile.address)
    WebDriverWait(browser, SECONDS).until(lambda b: "token" not in b.current_url)
    browser.get(hostile.base + address)
    WebDriverWait(browser, SECONDS).until(
        lambda b: says in b.find_element(By.TAG_NAME, "body").text
    )
    assert browser.execute_script("return globalThis.came") is None
    assert browser.find_elements(By.CSS_SELECTOR, "[onerror], [onclick]") == []
    logged = [line["message"] for line in browser.get_log("browser")]
    assert [line for line in logged if "came" in line] == []


@pytest.mark.slow
def test_a_page_of_the_folder_asks_no_server(browser, hostile):
    """It may be anyone's: not even who opens it, and when, is told."""
    browser.get(hostile.address)
    WebDriverWait(browser, SECONDS).until(lambda b: "token" not in b.current_url)
    browser.get(f"{hostile.base}/file?at=b/bench.html")
    logged = []

    def refused(b):
        logged.extend(line["message"] for line in b.get_log("browser"))
        return any("sandboxed" in line for line in logged)

    WebDriverWait(browser, SECONDS).until(refused)
    assert browser.current_url.endswith("bench.html")


def test_only_the_script_of_our_own_reports_may_run():
    """A script, or a page that refreshes itself, could go to any server."""
    ours = make_page(DEMO).html
    rights = headers_of(ours)["Content-Security-Policy"]
    assert f"script-src '{own_script()}'" in rights
    assert own_script().encode() in ours
    refresh = b'<META HTTP-EQUIV=refresh content="0;url=http://127.0.0.1:1/">'
    for page in (
        *(PAGE.encode(), refresh, b"<!doctype html>" + refresh, ours + refresh),
        *(ours.decode().encode("utf-16"), b""),
    ):
        rights = headers_of(page)["Content-Security-Policy"]
        assert rights.startswith("sandbox;")
