"""The pages in a real browser, as a user without the command line sees them."""

import contextlib
import json
import re
import shutil
import time

import cv2
import numpy as np
import pytest
from selenium.webdriver.common.action_chains import ActionChains
from selenium.webdriver.common.by import By
from selenium.webdriver.common.keys import Keys
from selenium.webdriver.support.ui import WebDriverWait
from studio_process import Studio, running_studio

from tdac_agent import load_task, synthesize
from tdac_agent.runs.replay import DEMO
from tdac_agent.studio.jobs import STATE, jobs
from tdac_agent.verification.verify_episodes import verify_episodes

SECONDS = 60
SIZES = {
    "desktop": (1440, 900), "laptop": (1180, 800), "narrow": (1024, 768),
    "phone": (390, 844),
}  # fmt: skip
# A controller that drives straight on, into a wall.
BLIND = """
def policy(obs):
    return 1.0, 1.0
"""
OVERFLOW = """
const page = document.documentElement;
return page.scrollWidth - page.clientWidth;
"""


@pytest.fixture
def page(browser, studio):
    """The studio in a window; afterwards nothing was complained about."""
    resize(browser, "desktop")
    browser.get(studio.address)
    wait(browser, lambda b: "token" not in b.current_url and b.title.startswith("New"))
    yield browser
    assert [
        line for line in browser.get_log("browser") if line["level"] != "INFO"
    ] == []


def resize(browser, name):
    width, height = SIZES[name]
    size = {"width": width, "height": height, "deviceScaleFactor": 1}
    size["mobile"] = name == "phone"
    browser.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", size)


def wait(browser, condition):
    return WebDriverWait(browser, SECONDS, 0.1).until(condition)


def text_of(browser):
    """What a person reads; nothing while the page still loads."""
    return browser.execute_script("return document.body ? document.body.innerText : ''")


def says(browser, text):
    wait(browser, lambda b: text in text_of(b))


def press(browser, name):
    """Clicks the button with a name."""
    path = f"//button[.//span[normalize-space()='{name}']]"
    button = wait(browser, lambda b: b.find_element(By.XPATH, path))
    wait(browser, lambda b: button.is_enabled())
    browser.execute_script("arguments[0].click()", button)


def choose(browser, text):
    """Clicks a radio button by the beginning of its label."""
    path = f"//*[@role='radio'][starts-with(normalize-space(.), '{text}')]"
    browser.execute_script("arguments[0].click()", browser.find_element(By.XPATH, path))


def upload(browser, file, label="Drop a file here"):
    path = f"//div[contains(@class,'q-uploader')][contains(., '{label}')]//input"
    wait(browser, lambda b: b.find_elements(By.XPATH, path))[0].send_keys(str(file))


def click_map(browser, x, y, size):
    """Clicks a place of the picture, in px of a map of this width and height."""
    image = browser.find_element(By.CSS_SELECTOR, ".board img")
    browser.execute_script("arguments[0].scrollIntoView({block: 'center'})", image)
    right = (x + 0.5) / size[0] - 0.5, (y + 0.5) / size[1] - 0.5
    over = right[0] * image.size["width"], right[1] * image.size["height"]
    ActionChains(browser).move_to_element_with_offset(image, *over).click().perform()


def type_in(browser, name, value):
    """Replaces the number in a field."""
    field = number(browser, name)
    field.send_keys(Keys.CONTROL, "a")
    field.send_keys(str(value), Keys.TAB)


@contextlib.contextmanager
def framed(browser):
    """Looks into the report that the page shows."""
    wait(browser, lambda b: b.find_elements(By.CSS_SELECTOR, "iframe.report"))
    browser.switch_to.frame(browser.find_element(By.CSS_SELECTOR, "iframe.report"))
    yield
    browser.switch_to.default_content()


def begin(browser):
    """Starts the run, and waits for its page."""
    press(browser, "Write and verify a controller")
    wait(browser, lambda b: "/run?" in b.current_url)


def number(browser, name):
    return browser.find_element(By.CSS_SELECTOR, f"input[aria-label='{name}']")


@pytest.fixture
def plan(tmp_path):
    """A plan of two rooms with a door, 400 x 300 px."""
    picture = np.full((300, 400), 255, np.uint8)
    picture[:8] = picture[-8:] = picture[:, :8] = picture[:, -8:] = 0
    picture[:, 196:204] = 0
    picture[120:190, 190:210] = 255
    cv2.imwrite(str(tmp_path / "plan.png"), picture)
    return tmp_path / "plan.png"


def open_plan(browser, plan):
    """Drops the plan, and clicks start, heading and goal."""
    upload(browser, plan)
    says(browser, "400 x 300 px")
    says(browser, "Click the start")
    for place in ((60, 150), (120, 150), (340, 60)):
        click_map(browser, *place, (400, 300))
        time.sleep(0.3)
    says(browser, "A path of")


@pytest.mark.slow
def test_from_a_dropped_image_to_a_verified_controller(page, studio, plan):
    """By clicks alone; the page shows the command, and the candidate drives."""
    open_plan(page, plan)
    says(page, "narrowest passage (bar) is 70 px wide: room for a radius of")
    assert page.find_elements(By.CSS_SELECTOR, ".board svg path.gap")
    assert number(page, "start x").get_attribute("value") == "60"
    assert abs(float(number(page, "heading, rad").get_attribute("value"))) < 0.05
    assert "tdac synth --map .studio/files/plan.png --start 60 150" in text_of(page)
    button = "//button[.//span[normalize-space()='Write and verify a controller']]"
    ActionChains(page).double_click(page.find_element(By.XPATH, button)).perform()
    wait(page, lambda b: "/run?" in b.current_url)
    wait(page, lambda b: b.find_elements(By.CSS_SELECTOR, ".status.verified"))
    begun = [job.file.about for job in jobs(studio.place)]
    assert [about for about in begun if "plan" in about] == ["runs/plan-1"]
    assert "not begun here" not in text_of(page)
    with framed(page):
        says(page, "all tests passed" if "all tests" in text_of(page) else "verified")
        clock = page.find_element(By.CSS_SELECTOR, ".player .clock")
        wait(page, lambda b: "reached" in clock.text)
    run = json.loads((studio.place / "runs/plan-1/run.json").read_text())
    assert run["status"] == "verified"


@pytest.mark.slow
def test_no_request_leaves_this_machine(browser, page, studio):
    """Nor does a page of it load anything from elsewhere."""
    names = "return performance.getEntriesByType('resource').map((e) => e.name)"
    for path in ("/", "/runs", "/worlds", "/benches"):
        browser.get(studio.base + path)
        says(browser, "tdac studio")
        time.sleep(1)
        for name in browser.execute_script(names):
            assert name.startswith((studio.base, "data:", "blob:")), name


@pytest.mark.slow
def test_a_goal_that_cannot_be_reached(page, plan):
    """The reason is shown, and nothing can be started."""
    open_plan(page, plan)
    click_map(page, 2, 2, (400, 300))
    says(page, "goal (2, 2) lies in an obstacle")
    path = "//button[.//span[normalize-space()='Write and verify a controller']]"
    assert not page.find_element(By.XPATH, path).is_enabled()
    click_map(page, 340, 250, (400, 300))
    says(page, "A path of")


@pytest.mark.slow
def test_a_robot_is_chosen_by_its_name(page, studio, plan):
    """Where metres are known; the command and the address say so."""
    ros = "image: {}\nresolution: 0.05\norigin: [0, 0, 0]\nnegate: 0\n"
    ros += "occupied_thresh: 0.65\nfree_thresh: 0.196\n"
    shutil.copy(plan, studio.place)
    (studio.place / "ros.yaml").write_text(ros.format(plan.name))
    page.get(f"{studio.base}/?source=map%3A%20ros.yaml")
    says(page, "a disc of this radius")
    field = page.find_element(By.CSS_SELECTOR, "input[aria-label='robot']")
    page.execute_script("arguments[0].click()", field)
    path = "//div[@role='option'][normalize-space(.)='turtlebot3-burger']"
    wait(page, lambda b: b.find_elements(By.XPATH, path))[0].click()
    says(page, "--robot turtlebot3-burger")
    says(page, "full speed 0.22 m/s")
    wait(page, lambda b: "robot=turtlebot3-burger" in b.current_url)


@pytest.mark.slow
def test_a_controller_of_ones_own_is_repaired(page, plan, tmp_path):
    """It is the first candidate; the report has what it failed, and its successor."""
    (tmp_path / "blind.py").write_text(BLIND)
    open_plan(page, plan)
    choose(page, "a controller of my own")
    says(page, "Add your controller first.")
    upload(page, tmp_path / "blind.py", "Drop controller.py here")
    says(page, "--from .studio/files/blind.py")
    says(page, "The controller is blind.py.")
    press(page, "Write and verify a controller")
    wait(page, lambda b: b.find_elements(By.CSS_SELECTOR, ".status.verified"))
    with framed(page):
        wait(page, lambda b: len(b.find_elements(By.CSS_SELECTOR, "a.cell")) > 1)
        assert page.find_elements(By.CSS_SELECTOR, "a.cell.failed")
    says(page, "The controller that passed is another one, by the built-in template.")


@pytest.mark.slow
def test_two_runs_side_by_side(page, studio, plan):
    """Their figures in one table, and both reports."""
    run = studio.place / "runs/compared"
    synthesize(load_task("maze"), "builtin", out=run)
    shutil.copytree(run, studio.place / "runs/copy", dirs_exist_ok=True)
    page.get(f"{studio.base}/compare?one=runs/compared&other=runs/copy")
    wait(page, lambda b: len(b.find_elements(By.CSS_SELECTOR, "iframe.report")) == 2)
    cells = [cell.text for cell in page.find_elements(By.CSS_SELECTOR, "td")]
    assert cells[:4] == ["", "status", "verified", "verified"]
    assert page.find_elements(By.CSS_SELECTOR, ".compared .differs") == []
    assert "The controllers are the same." in text_of(page)
    page.get(f"{studio.base}/compare?one=runs/compared&other=runs/missing")
    says(page, "There is no run 'runs/missing'")


@pytest.mark.slow
def test_a_person_answers(page, plan):
    """The page says what is asked for, and why an answer cannot be used."""
    open_plan(page, plan)
    choose(page, "a person, or a chat window")
    press(page, "Write and verify a controller")
    says(page, "The run waits for a controller")
    box = page.find_element(By.TAG_NAME, "textarea")
    box.send_keys("I cannot write code.")
    press(page, "Use this answer")
    says(page, "Answer 1 of at most 3 cannot be used: it has no fenced block.")
    press(page, "Stop")
    wait(page, lambda b: b.find_elements(By.CSS_SELECTOR, ".status.interrupted"))
    wait(page, lambda b: "The run waits" not in text_of(b))


@pytest.mark.slow
def test_the_keyboard_alone(page, plan):
    """Places are typed, the button is reached by Tab and pressed by Enter."""
    upload(page, plan)
    says(page, "Click the start")
    places = {"start x": 60, "start y": 60, "goal x": 340, "goal y": 250}
    for name, value in places.items():
        type_in(page, name, value)
        time.sleep(0.2)
    says(page, "A path of")
    for _ in range(40):
        focused = page.switch_to.active_element
        if focused.text.upper().startswith("WRITE AND VERIFY"):
            break
        focused.send_keys(Keys.TAB)
    page.switch_to.active_element.send_keys(Keys.ENTER)
    wait(page, lambda b: "/run?" in b.current_url)


@pytest.mark.slow
def test_the_form_of_a_bench_shows_its_command(page, studio):
    """It starts nothing without worlds; a bench is a page with the studio's links."""
    page.get(f"{studio.base}/benches")
    says(page, "tdac bench builtin follow-the-gap --set unknown --split test -n 20")
    field = number(page, "worlds of each set")
    field.send_keys(Keys.BACKSPACE, Keys.BACKSPACE)
    says(page, "Choose entrants, task sets and the number of worlds.")
    path = "//button[.//span[normalize-space()='Start the bench']]"
    assert not page.find_element(By.XPATH, path).is_enabled()
    made = studio.place / "runs" / "bench-made"
    made.mkdir(parents=True)
    (made / "bench.json").write_text("{}")
    (made / "bench.html").write_text("<h1>Who is better</h1>")
    page.get(f"{studio.base}/runs")
    wait(page, lambda b: b.find_element(By.LINK_TEXT, "runs/bench-made")).click()
    wait(page, lambda b: b.find_elements(By.CSS_SELECTOR, ".status.finished"))
    assert page.find_element(By.CSS_SELECTOR, "header a[href='/runs']").is_displayed()
    with framed(page):
        says(page, "Who is better")
    shutil.rmtree(made)


@pytest.mark.slow
def test_a_bench_goes_on_while_its_page_is_closed(page, studio):
    page.get(f"{studio.base}/benches")
    type_in(page, "worlds of each set", 2)
    says(page, "--split test -n 2")
    press(page, "Start the bench")
    says(page, "of 4 episodes driven")
    address = page.current_url
    page.get(f"{studio.base}/benches")
    wait(page, lambda b: b.find_element(By.LINK_TEXT, "runs/bench-1"))
    page.get(address)
    wait(page, lambda b: b.find_elements(By.CSS_SELECTOR, ".status.finished"))
    with framed(page):
        says(page, "2 entrants on unknown")
    found = json.loads((studio.place / "runs/bench-1/bench.json").read_text())
    assert found["entrants"] == ["builtin", "follow-the-gap"]


@pytest.mark.slow
def test_a_bench_is_stopped_and_continued(page, studio):
    """It goes on with the next episode: what was driven before is kept."""
    page.get(f"{studio.base}/benches")
    type_in(page, "worlds of each set", 6)
    says(page, "--split test -n 6")
    press(page, "Start the bench")
    wait(page, lambda b: re.search(r"\b[1-5] of 12 episodes driven", text_of(b)))
    press(page, "Stop")
    wait(page, lambda b: b.find_elements(By.CSS_SELECTOR, ".status.not-finished"))
    says(page, "; Continue resumes with the next episode")
    folder = studio.place / page.current_url.partition("?at=")[2]
    (rows,) = folder.glob("driven/*/*/unfinished/episodes.jsonl")
    before = [json.loads(line) for line in rows.read_text().splitlines()]
    assert 0 < len(before) < 6
    page.get(f"{studio.base}/runs")
    says(page, "builtin, follow-the-gap on unknown")
    page.find_element(By.LINK_TEXT, str(folder.relative_to(studio.place))).click()
    press(page, "Continue")
    wait(page, lambda b: b.find_elements(By.CSS_SELECTOR, ".status.running"))
    assert f"{len(before)} of 12 episodes driven" in text_of(page)
    wait(page, lambda b: b.find_elements(By.CSS_SELECTOR, ".status.finished"))
    report = json.loads((rows.parent.parent / "episodes.json").read_text())
    # Its CPU time tells an episode from another one on the same world.
    assert report["episodes"][: len(before)] == before


@pytest.mark.slow
def test_a_world_is_driven_by_the_keyboard(page, studio):
    """Straight ahead, the robot of this world meets a wall within seconds."""
    page.get(f"{studio.base}/worlds?level=unknown")
    says(page, "narrowest passage")
    press(page, "Drive")
    status = page.find_element(By.CSS_SELECTOR, "[role=status]")
    wait(page, lambda b: status.text)  # "Go." is soon replaced by the time
    body = page.find_element(By.TAG_NAME, "body")
    ActionChains(page).key_down(Keys.ARROW_UP, body).perform()
    wait(page, lambda b: "contact" in status.text)
    ActionChains(page).key_up(Keys.ARROW_UP, body).perform()
    assert status.text.endswith(" s – press R to begin again")
    ActionChains(page).send_keys("r").perform()
    wait(page, lambda b: "contact" not in status.text)


@pytest.mark.slow
def test_a_controller_for_a_set_of_worlds(page, studio):
    """With few episodes; the page says how many have been driven."""
    page.get(f"{studio.base}/worlds?level=unknown")
    says(page, "narrowest passage")
    assert "without movers" not in text_of(page)
    press(page, "Write a controller for the whole set …")
    says(page, "tdac synth --set unknown --episodes 128")
    type_in(page, "episodes at most", 4)
    wait(page, lambda b: "--episodes 4\n" in text_of(b))
    press(page, "Write it")
    wait(page, lambda b: "/run?" in b.current_url)
    says(page, "of at most 4 episodes driven")
    says(page, "The first candidate appears here as soon as it has been tested.")
    wait(page, lambda b: b.find_elements(By.CSS_SELECTOR, ".status.selected"))
    says(page, "Only hidden worlds, which nobody has seen, can verify it.")


@pytest.mark.slow
def test_a_campaign_is_a_card_with_its_runs_folded(page, studio):
    """What is not verified comes first; on 1024 px nothing scrolls sideways."""
    campaign = studio.place / "campaigns" / "folded"
    runs = campaign / "runs" / "maze-builtin-with-a-long-name-0123456789abcdef"
    for number, status in enumerate(("verified", "not verified", "verified"), 1):
        shutil.copytree(DEMO, runs / f"r{number:04d}")
        record = runs / f"r{number:04d}" / "run.json"
        run = json.loads(record.read_text())
        run |= {"status": status, "cost": 0.25 * number, "tokens_in": 1}
        record.write_text(json.dumps(run))
    (campaign / "campaign.yaml").write_text("name: folded\n")
    (studio.place / "campaigns/new").mkdir()
    (studio.place / "campaigns/new/campaign.yaml").write_text("name: new\n")
    resize(page, "narrow")
    page.get(f"{studio.base}/runs")
    card = "//*[contains(@class,'campaign')][.//h2='campaigns/folded']"
    found = wait(page, lambda b: b.find_element(By.XPATH, card))
    rows = found.find_elements(By.CSS_SELECTOR, "tbody tr")
    assert not rows[0].is_displayed()
    page.execute_script("arguments[0].click()", found.find_element(
        By.CSS_SELECTOR, ".q-expansion-item .q-item"
    ))  # fmt: skip
    wait(page, lambda b: rows[0].is_displayed())
    assert [row.text.split("/")[1].split()[0] for row in rows] == [
        "r0002", "r0001", "r0003",
    ]  # fmt: skip
    assert "verified" in found.text.splitlines()[1]
    assert page.execute_script(OVERFLOW) <= 0
    inner = "const e = arguments[0]; return e.scrollWidth - e.clientWidth"
    for table in page.find_elements(By.CSS_SELECTOR, ".q-table__middle"):
        assert page.execute_script(inner, table) <= 0
    assert "tdac campaign campaigns/new/campaign.yaml --out campaigns/new" in (
        text_of(page)
    )
    found.find_element(By.LINK_TEXT, "Report").click()
    wait(page, lambda b: "/campaign?at=" in b.current_url)
    with framed(page):
        says(page, "runs verified")
    page.get(f"{studio.base}/run?at={(runs / 'r0001').relative_to(studio.place)}")
    trail = wait(page, lambda b: b.find_element(By.CSS_SELECTOR, "nav.trail"))
    trail.find_element(By.LINK_TEXT, "campaigns/folded").click()
    wait(page, lambda b: "/campaign?at=" in b.current_url)
    shutil.rmtree(studio.place / "campaigns")
    resize(page, "desktop")


@pytest.mark.slow
def test_pages_without_anything_say_what_to_do(browser, tmp_path):
    """An empty folder: a sentence on each page, with a link or a command."""
    with running_studio(tmp_path) as empty:
        browser.get(empty.address)
        wait(browser, lambda b: b.title.startswith("New"))
        says(browser, "This folder has no map or world of its own yet.")
        browser.get(f"{empty.base}/runs")
        says(browser, "No run in this folder yet.")
        assert "tdac synth" in text_of(browser)
        assert browser.find_elements(By.CSS_SELECTOR, ".empty a[href='/']")
        browser.get(f"{empty.base}/benches")
        says(browser, "No bench in this folder yet. Start the one above.")
        says(browser, "No controller of your own is in this folder yet")
        browser.get(f"{empty.base}/worlds")
        says(browser, "No controller of your own is in this folder yet")
        browser.get_log("browser")  # its end


@pytest.mark.slow
def test_a_phone_shows_all_columns_of_a_run(page, studio):
    """As a card, with the name of each."""
    shutil.copytree(DEMO, studio.place / "runs" / "on-a-phone")
    resize(page, "phone")
    page.get(f"{studio.base}/runs")
    cells = "//tr[contains(., 'on-a-phone')]/td"
    wait(page, lambda b: b.find_elements(By.XPATH, cells))
    assert page.execute_script(OVERFLOW) <= 0
    found = page.find_elements(By.XPATH, cells)
    values = [cell.text for cell in found[1:]]
    assert values[:4] == ["runs/on-a-phone", "maze", "manual:maze2", "passed"]
    label = "return getComputedStyle(arguments[0], '::before').content"
    labels = [page.execute_script(label, cell).strip('"') for cell in found[2:]]
    assert labels == ["task", "writer", "status", "progress", "cost", "started"]
    for cell in found:
        assert 0 <= cell.rect["x"] <= cell.rect["x"] + cell.rect["width"] <= 390
    shutil.rmtree(studio.place / "runs" / "on-a-phone")
    resize(page, "desktop")


def test_the_map_is_beside_its_controls(page, studio):
    """Not below them, where they are out of sight."""
    resize(page, "laptop")
    says(page, "A path of")
    image = page.find_element(By.CSS_SELECTOR, ".board")
    controls = page.find_element(By.CSS_SELECTOR, ".q-uploader")
    assert image.rect["y"] < controls.rect["y"]
    assert image.rect["x"] > controls.rect["x"] + controls.rect["width"]
    assert image.rect["width"] > 600
    resize(page, "desktop")


@pytest.mark.slow
def test_a_map_and_what_was_found_are_in_sight(page, studio, tmp_path):
    """A tall one too, and on a phone, where the controls are below the map."""
    picture = np.full((900, 300), 255, np.uint8)
    picture[:8] = picture[-8:] = picture[:, :8] = picture[:, -8:] = 0
    picture[446:454] = 0
    cv2.imwrite(str(tmp_path / "tall.png"), picture)
    upload(page, tmp_path / "tall.png")
    says(page, "300 x 900 px")
    for name in ("desktop", "phone"):
        resize(page, name)
        for place in ((60, 100), (60, 200), (200, 800)):
            choice = {100: "click the start", 200: "its heading", 800: "the goal"}
            press(page, choice[place[1]])
            click_map(page, *place, (300, 900))
        says(page, "are not connected")
        height = SIZES[name][1]
        page.execute_script("scrollTo(0, 0)")
        view = page.find_element(By.CSS_SELECTOR, ".board").rect
        assert view["width"] > 100
        assert view["y"] + view["height"] < height
        found = page.find_element(By.CSS_SELECTOR, ".found").rect
        assert found["y"] + found["height"] <= height
    resize(page, "desktop")


@pytest.mark.slow
@pytest.mark.parametrize("size", SIZES)
def test_nothing_is_cut_off(page, studio, size):
    resize(page, size)
    for path in ("/", "/runs", "/worlds", "/benches"):
        page.get(studio.base + path)
        says(page, "New controller")
        time.sleep(1)
        assert page.execute_script(OVERFLOW) <= 0, path
    resize(page, "desktop")


@pytest.mark.slow
def test_a_killed_server_kills_no_run(browser, page, studio, plan):
    """Another one in the same folder finds the run again."""
    open_plan(page, plan)
    begin(page)
    at = page.current_url.partition("?at=")[2]
    base = studio.base
    studio.kill()
    says(page, "The studio has ended, or cannot be reached. Start it again")
    says(page, str(studio.place))
    studio.start()
    assert studio.base == base  # though it was not told which port to take
    # The page goes on by itself.
    wait(page, lambda b: b.find_elements(By.CSS_SELECTOR, ".status.verified"))
    assert page.current_url == f"{base}/run?at={at}"
    wait(page, lambda b: not b.find_element(By.ID, "lost").is_displayed())
    browser.get(f"{base}/runs")
    says(browser, at)
    browser.get_log("browser")  # the connection was lost


@pytest.mark.slow
def test_a_page_says_that_another_studio_has_its_port(browser, page, studio, tmp_path):
    """Its cookie is good for its own folder alone."""
    browser.get(f"{studio.base}/runs")
    says(browser, "A run from elsewhere")
    studio.kill()
    other = Studio(tmp_path, int(studio.base.rpartition(":")[2]))
    other.start()
    says(browser, "open the address that it printed")
    browser.get(other.address)
    wait(browser, lambda b: "token" not in b.current_url and b.title.startswith("New"))
    other.kill()
    studio.start()
    browser.get(studio.address)
    wait(browser, lambda b: "token" not in b.current_url and b.title.startswith("New"))
    browser.get_log("browser")  # the connection was lost


@pytest.mark.slow
def test_an_address_has_the_chosen_task(page, plan):
    """Loading the page again loses no click."""
    open_plan(page, plan)
    wait(page, lambda b: "task=60,150," in b.current_url)
    page.refresh()
    says(page, "A path of")
    assert number(page, "start x").get_attribute("value") == "60"
    assert number(page, "goal y").get_attribute("value") == "60"


@pytest.mark.slow
def test_a_map_that_may_be_read_in_two_ways(page, studio, tmp_path):
    """The user sees it, and says which pixels are the obstacles."""
    picture = np.full((300, 400), 128, np.uint8)
    picture[:, :200] = 100
    picture[100:200, 100:300] = 160
    cv2.imwrite(str(tmp_path / "either.png"), picture)
    page.get(f"{studio.base}/?source=world: maze")  # of which nothing is to be said
    says(page, "Webots")
    upload(page, tmp_path / "either.png")
    says(page, "may be its dark or its light pixels: choose above")
    image = page.find_element(By.CSS_SELECTOR, ".board img")
    wait(page, lambda b: image.rect["height"] > 200)
    press(page, "are light")
    says(page, "obstacles are light pixels")
    wait(page, lambda b: "obstacles=light" in b.current_url)
    page.refresh()
    says(page, "obstacles are light pixels")
    page.get(f"{studio.base}/?task=1,2,3,4,5,x")  # no such address
    says(page, "A path of")


@pytest.mark.slow
def test_two_runs_are_compared(page, studio):
    """Chosen from the list, which shows new runs by itself; what differs is marked."""
    page.get(f"{studio.base}/runs")
    says(page, "A run from elsewhere")
    for name, source in (("one", "A = 1\n<b>B</b>\n"), ("other", "A = 2\n<b>B</b>\n")):
        folder = studio.place / "runs" / f"compared-{name}"
        shutil.copytree(DEMO, folder)
        (folder / "controller.py").write_text(source)
    record = folder / "run.json"
    run = json.loads(record.read_text())
    record.write_text(json.dumps({**run, "seconds": 12345.0}))
    for name in ("one", "other"):
        row = f"//tr[contains(., 'compared-{name}')]//*[@role='checkbox']"
        box = wait(page, lambda b, row=row: b.find_elements(By.XPATH, row))[0]
        page.execute_script("arguments[0].click()", box)
    press(page, "Compare them")
    wait(page, lambda b: "/compare?one=" in b.current_url)
    says(page, "settings are the same")
    rows = page.find_elements(By.CSS_SELECTOR, ".compared tr.differs")
    assert [row.text.split()[:2] for row in rows] == [["≠", "time"]]
    diff = wait(page, lambda b: b.find_element(By.CSS_SELECTOR, "pre.diff"))
    assert diff.find_element(By.TAG_NAME, "del").text == "-A = 1"
    assert diff.find_element(By.TAG_NAME, "ins").text == "+A = 2"
    assert "<b>B</b>" in diff.text  # a controller is data
    page.get(f"{studio.base}/compare?one=runs/compared-one&other=runs/compared-one")
    says(page, "Choose two different runs.")
    for name in ("one", "other"):
        shutil.rmtree(studio.place / "runs" / f"compared-{name}")


@pytest.mark.slow
def test_disturbed_episodes_have_short_names(page, studio, small_task, good, warm):
    """Not the ten digits of a seed; a click draws the episode."""
    shutil.copytree(DEMO, studio.place / "runs" / "robust")
    out = studio.place / STATE / "robust" / "runs-robust"
    source, first = good / "controller.py", 2873645123
    verify_episodes(source, small_task, 3, first=first, out=out, judge=warm)
    page.get(f"{studio.base}/run?at=runs/robust")
    says(page, "3 of 3 episodes reached the goal")
    shown = wait(page, lambda b: re.findall(r"episode \d+: reached", text_of(b)))
    assert sorted(shown) == [f"episode {number}: reached" for number in (1, 2, 3)]
    assert str(first)[:8] not in text_of(page)
    button = "//button[.//span[contains(., 'episode 2: reached')]]"
    page.execute_script("arguments[0].click()", page.find_element(By.XPATH, button))
    says(page, "episode 2: drawing …")
    shutil.rmtree(studio.place / "runs" / "robust")
