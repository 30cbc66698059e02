"""Providers without a vendor: a program, a person, a recorded run."""

import json
import os
import re
import shutil
import signal
import subprocess
import sys
import threading
import tomllib
from dataclasses import replace
from pathlib import Path

import pytest
from script import STILL
from unconfirmed import synthesize

from tdac_agent import load_task
from tdac_agent.errors import Fault, ProviderError
from tdac_agent.models.choice import Options, choose_model, choose_models
from tdac_agent.models.manual import Manual
from tdac_agent.models.provider import (
    PermanentFault,
    ProviderFault,
    Reply,
    Request,
    missing_for,
    recorded_seed,
)
from tdac_agent.runs.run_record import load_run
from tdac_envs.core.extras import install_command

QUESTION = Request("generate", "Wände? ÄÖ\n" * 20_000)


@pytest.fixture
def options(small_task):
    return Options(small_task.setting)


@pytest.fixture
def program(tmp_path, options):
    """A provider that is a Python program."""

    def make(source):
        path = tmp_path / "model.py"
        path.write_text(source)
        return choose_model(f"command:{sys.executable} '{path}'", options)

    return make


def test_a_program_answers(program):
    """The whole prompt on its stdin, its whole stdout is the answer."""
    model = program(
        "import sys; text = sys.stdin.buffer.read()\n"
        "sys.stdout.buffer.write(text[::-1][:9][::-1] + str(len(text)).encode())\n"
    )
    prompt = QUESTION.prompt
    expected = prompt.encode()[-9:].decode() + str(len(prompt.encode()))
    assert model.complete(QUESTION) == Reply(expected)
    assert model.paid


@pytest.mark.slow_after(1)
@pytest.mark.parametrize(
    ("source", "reason"),
    [
        ("import sys; sys.exit('no quota')", "exit code 1: no quota"),
        ("import os; os.kill(os.getpid(), 9)", "ended by signal 9"),
        ("import time; time.sleep(60)", "no answer in 1 s"),
        (
            "import os, time\nif os.fork(): os._exit(0)\ntime.sleep(60)",
            "no answer in 1 s",
        ),
    ],
)
def test_a_program_that_fails(program, no_traces, source, reason):
    """A fault in one line; nothing that it started goes on running."""
    model = program(source)
    with pytest.raises(ProviderFault, match=reason) as caught:
        model.complete(replace(QUESTION, seconds=1.0))
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        (
            "#!/no/such/interp -x\n",
            r"No such file .*first line is '#!/no/such/interp -x'",
        ),
        ("\0\0\0\0", "Exec format error$"),
    ],
)
def test_a_program_that_cannot_be_started(tmp_path, options, text, reason):
    """It is not tried again, and the line says what is wrong with which program."""
    script = tmp_path / "model"
    script.write_text(text)
    script.chmod(0o755)
    with pytest.raises(PermanentFault, match=reason) as caught:
        choose_model(f"command:'{script}'", options).complete(QUESTION)
    assert f"cannot start '{script}': " in str(caught.value)
    assert not caught.value.billed


ASKS = """
import signal, sys
from tdac_agent.models.choice import Options, choose_model
from tdac_agent.models.provider import Request
from tdac_agent.synthesis.side_by_side import side_by_side

# As the command line does.
signal.signal(signal.SIGTERM, signal.default_int_handler)
model = choose_model(sys.argv[1], Options(None))
side_by_side([lambda: model.complete(Request("generate", "x"))] * 2)
"""


@pytest.mark.slow_after(1)
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_no_program_outlives_an_interrupt(tmp_path, no_traces, number):
    """Nor does what it started, although the threads that asked are not awaited."""
    begun = tmp_path / "begun"
    os.mkfifo(begun)
    command = f"command:sh -c 'echo begun > {begun}; sleep 60; echo late'"
    asking = subprocess.Popen(
        [sys.executable, "-c", ASKS, command], stderr=subprocess.PIPE
    )
    with begun.open() as said:
        assert said.readline() == "begun\n"
        asking.send_signal(number)
        _, err = asking.communicate(timeout=30)
    assert err.splitlines()[-1] == b"KeyboardInterrupt"


@pytest.mark.slow_after(1)
@pytest.mark.parametrize(
    ("source", "reason"),
    [
        ("import os\nwhile 1: os.write(1, b'a' * 65536)", "wrote more than 8 MB"),
        ("print('a' * 3_000_000)", "more than 2000000 characters"),
        (
            "import os, sys\nfor _ in range(999): os.write(2, b'b' * 65536)\n"
            "sys.exit('no quota')",
            "exit code 1: .*",
        ),
    ],
)
def test_a_program_that_writes_too_much(program, no_traces, source, reason):
    """A fault in one line, and not all of it is held; both streams are read."""
    with pytest.raises(ProviderFault, match=reason) as caught:
        program(source).complete(QUESTION)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("encoding", ["utf-8-sig", "utf-16"])
def test_a_program_with_an_encoding_of_its_own(program, encoding):
    """Its byte order mark names it."""
    source = f"import sys; sys.stdout.buffer.write('é = 1'.encode('{encoding}'))"
    assert program(source).complete(QUESTION).text == "é = 1"


def test_a_program_reads_a_long_prompt_while_it_writes(program):
    """Neither side waits for the other."""
    source = "import sys\nfor line in sys.stdin: print(line, end='')"
    prompt = "x" * 99 + "\n"
    question = replace(QUESTION, prompt=prompt * 10_000)
    assert program(source).complete(question).text == question.prompt


def test_a_person_answers_at_length(tmp_path):
    """More than an answer may have is a fault, not a file of the run."""
    (tmp_path / "001.reply.md").write_text("a" * 2_000_001)
    with pytest.raises(ProviderFault, match="more than 2000000 characters"):
        Manual(tmp_path, poll=0.0).complete(QUESTION)
    (tmp_path / "001.reply.md").write_bytes("é = 1".encode("utf-16"))
    assert Manual(tmp_path, poll=0.0).complete(QUESTION).text == "é = 1"


def test_a_program_that_does_not_read(program):
    """It need not read the prompt to answer."""
    assert program("print('yes')").complete(QUESTION).text == "yes\n"


def answer_in(folder, texts):
    """Somebody who answers each question once it is there."""

    def work():
        for number, text in enumerate(texts, start=1):
            question = folder / f"{number:03}.prompt.md"
            while not question.exists() and not given_up.wait(0.005):
                pass
            (folder / f"{number:03}.reply.md").write_text(text)

    given_up = threading.Event()
    thread = threading.Thread(target=work)
    thread.start()
    return lambda: (given_up.set(), thread.join())


def test_a_person_answers(tmp_path, capsys):
    """Questions and answers are numbered files; equal questions are put again."""
    folder = tmp_path / "mail"
    folder.mkdir()
    done = answer_in(folder, ["one", "two", "three"])
    model = Manual(folder, poll=0.005)
    other = replace(QUESTION, prompt="other")
    questions = [QUESTION, replace(QUESTION, repeat=1), other]
    texts = [model.complete(question).text for question in questions]
    done()
    assert texts == ["one", "two", "three"]
    assert capsys.readouterr().err.count("waiting: write the answer") == 3
    assert (folder / "003.prompt.md").read_text() == "other"
    # A second life finds all answers, in the same order.
    again = Manual(folder, poll=0.005)
    assert [again.complete(question).text for question in questions] == texts
    # They may be those of another run, so it says which it takes, and of when.
    told = capsys.readouterr().err.splitlines()
    replies = sorted(folder.glob("*.reply.md"))
    assert [line.split(",")[0] for line in told] == [f"using {x}" for x in replies]
    assert all("which already existed, written 20" in line for line in told)
    assert len(list(folder.iterdir())) == 6
    # Who remembers the first answer asks for the second alone, and gets that one.
    assert Manual(folder, poll=0.005).complete(questions[1]).text == "two"


def test_a_reply_that_is_being_written(tmp_path):
    """An empty file is no answer yet."""
    (tmp_path / "001.reply.md").write_text(" \n")
    model = Manual(tmp_path, poll=0.005)
    looks = iter(range(3))

    def write():
        while (
            next(looks, None) is not None and not (tmp_path / "001.prompt.md").exists()
        ):
            event.wait(0.01)
        (tmp_path / "001.reply.md").write_text("whole")

    event = threading.Event()
    thread = threading.Thread(target=write)
    thread.start()
    assert model.complete(QUESTION).text == "whole"
    thread.join()


def test_a_folder_that_is_gone(tmp_path):
    """One line, and no second try."""
    folder = tmp_path / "mail"
    folder.mkdir()
    model = Manual(folder)
    folder.rmdir()
    with pytest.raises(PermanentFault, match="No such file"):
        model.complete(QUESTION)


@pytest.fixture(scope="module")
def once_recorded(policy_task, good_source, tmp_path_factory, warm):
    """A run: a refusal to write code, one that stands still, its repair."""
    folder = tmp_path_factory.mktemp("mail")
    answers = ["I would rather not.", STILL, good_source]
    fenced = [answers[0], *(f"```python\n{text}```\n" for text in answers[1:])]
    done = answer_in(folder, fenced)
    out = folder.with_name("recorded")
    run = synthesize(policy_task, Manual(folder, poll=0.005), out=out, judge=warm)
    done()
    assert run.passed
    return out


@pytest.fixture
def recorded(once_recorded, tmp_path):
    """That run, to be damaged."""
    return shutil.copytree(once_recorded, tmp_path / "recorded")


@pytest.mark.slow
def test_a_run_is_replayed(policy_task, recorded, tmp_path, warm):
    """The same answers to the same questions: the same run, from the record alone."""
    out = tmp_path / "again"
    run = synthesize(policy_task, f"replay:{recorded}", out=out, judge=warm)
    before = load_run(recorded)
    assert [a.model_dump() for a in run.attempts] == [
        a.model_dump() for a in before.attempts
    ]
    assert run.controller.read_text() == before.controller.read_text()
    for name in ("generate.reply.md", "generate.reply-2.md"):
        old, new = (x / "iterations/k01/j0" / name for x in (recorded, out))
        assert old.read_bytes() == new.read_bytes()


@pytest.mark.slow
def test_a_replay_has_the_seed_on_record(recorded, tmp_path, good, tdac):
    """Of a run that was begun here; the author of another may have aimed at it."""
    words = ["--task", good, "--seed", 5, "-K", 1, "-J", 0]
    assert tdac("synth", *words, "--out", "first")[0] == 0
    options = Options(load_task(good).setting)
    assert recorded_seed(choose_model("replay:first", options)) == 5
    record = json.loads(Path("first/run.json").read_text())
    Path("first/run.json").write_text(json.dumps({**record, "seed": 0}))
    assert recorded_seed(choose_model("replay:first", options)) is None
    assert recorded_seed(choose_model("replay:demo", options)) == 0
    assert recorded_seed(choose_model(f"replay:{recorded}", options)) is None


def test_a_miss_is_an_error(policy_task, recorded, tmp_path, small_task, warm):
    """Another question, or one too many, is a fault that says where."""
    with pytest.raises(Fault, match=r"replay:.*: the question differs .* line \d+"):
        synthesize(small_task, f"replay:{recorded}", out=tmp_path / "other", judge=warm)
    (recorded / "iterations/k01/j1/edit.reply.md").unlink()
    with pytest.raises(Fault, match=r"answer 1 to edit k=1 j=1 is not in"):
        synthesize(
            policy_task, f"replay:{recorded}", out=tmp_path / "again", judge=warm
        )


@pytest.mark.parametrize(
    ("name", "reason"),
    [
        ("gpt", "unknown model 'gpt'; known: builtin, anthropic:MODEL"),
        ("antropic:x", r"unknown model 'antropic:x' \(did you mean 'anthropic'\?\)"),
        ("", "unknown model ''"),
        ("gpt-4o", r"'gpt-4o' \(did you mean openai:gpt-4o\?\); known: builtin"),
        ("o3", r"\(did you mean openai:o3\?\)"),
        ("claude-sonnet-5-5", r"\(did you mean anthropic:claude-sonnet-5-5\?\)"),
        ("anthropic/claude-x", r"\(did you mean anthropic:claude-x\?\)"),
        ("gemini-3-pro", "did you mean openai:gemini-3-pro --base-url https://gen.*/"),
        (
            "ollama:qwen3:8b",
            "mean openai:qwen3:8b --base-url http://localhost:11434/v1",
        ),
        ("llama.cpp:x", "mean openai:x --base-url http://localhost:8080/v1"),
        ("olama:qwen3", "unknown model 'olama:qwen3'; known"),
        ("builtin:x", "'builtin' takes no model name"),
        ("anthropic:", "anthropic: needs a model, as in anthropic:claude"),
        ("openai", "openai: needs a model, as in openai:gpt"),
        ("command:", "command: needs a program, as in"),
        ("command:'", "No closing quotation"),
        ("command:no-such-program-here -x", "no program 'no-such-program-here'"),
        ("manual:", "manual: needs a folder, as in"),
        ("manual:/proc/none/x", "cannot make /proc/none/x"),
        ("replay:", "needs a run folder"),
        ("replay:/nowhere", "cannot replay: /nowhere is not a run folder"),
    ],
)
def test_names_that_cannot_be_used(options, monkeypatch, name, reason):
    """One line that says what to do."""
    with pytest.raises(ProviderError, match=reason) as caught:
        choose_model(name, options)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("url", "learner", "optimizer", "reason"),
    [
        ("localhost:8000", "openai:x", None, "is not a valid URL; expected one like"),
        ("http://", "openai:x", None, "is not a valid URL"),
        ("http://[::1", "openai:x", None, "is not a valid URL"),
        ("http://me:secret@here/v1", "openai:x", None, "no user, password or query"),
        ("http://here/v1?key=secret", "openai:x", None, "no user, password or query"),
        ("http://here/v1", "builtin", None, "no such model is used"),
        ("http://here/v1", "openai:x", "anthropic:y", "for anthropic and openai"),
    ],
)
def test_addresses_that_cannot_be_used(
    small_task, url, learner, optimizer, reason, canary
):
    """They are refused before anything is asked, and no secret is repeated."""
    with pytest.raises(ProviderError, match=reason) as caught:
        choose_models(learner, optimizer, small_task.setting, url)
    assert "secret" not in str(caught.value)


@pytest.mark.parametrize("vendor", ["anthropic", "openai"])
def test_a_missing_key(options, vendor, monkeypatch):
    """It is named, unless the models are served elsewhere."""
    name = f"{vendor.upper()}_API_KEY"
    monkeypatch.delenv(name, raising=False)
    monkeypatch.delenv(f"{vendor.upper()}_BASE_URL", raising=False)
    (line,) = choose_model(f"{vendor}:x", options).missing
    assert line.endswith(f"set the environment variable {name}")
    elsewhere = replace(options, base_url="http://127.0.0.1:9/v1")
    assert choose_model(f"{vendor}:x", elsewhere).missing == ()
    monkeypatch.setenv(name, "two words")
    (line,) = choose_model(f"{vendor}:x", options).missing
    assert "is not a valid key" in line


@pytest.mark.parametrize("vendor", ["anthropic", "openai"])
def test_a_missing_package(options, vendor, monkeypatch, canary):
    """The pip command that brings it; to ask without it is a fault that stays."""
    extra = None if vendor == "anthropic" else vendor
    monkeypatch.setitem(sys.modules, vendor, None)
    model = choose_model(f"{vendor}:x", options)
    (line,) = model.missing
    assert line.endswith(f": {install_command(extra)}")
    with pytest.raises(PermanentFault, match=vendor):
        model.complete(QUESTION)


def test_every_installation_has_these_packages():
    """The package of Anthropic among them, so it is no extra; that of OpenAI is one."""
    root = Path(__file__).parents[3]
    project = tomllib.loads((root / "pyproject.toml").read_text())["project"]
    names = {re.match(r"[\w-]+", line)[0] for line in project["dependencies"]}
    assert names >= {
        *("gymnasium", "pymunk", "numpy", "opencv-python-headless", "anthropic"),
        *("pytest", "pandas", "matplotlib"),
    }
    assert "openai" not in names
    assert "anthropic" not in project["optional-dependencies"]
    assert "openai" in project["optional-dependencies"]


@pytest.mark.parametrize("vendor", ["anthropic", "openai"])
def test_a_package_is_loaded_with_the_first_question(options, vendor, monkeypatch):
    """It takes a second or two, in which a run has long begun to show what it does."""
    monkeypatch.setenv(f"{vendor.upper()}_API_KEY", "sk-none")
    monkeypatch.delitem(sys.modules, vendor, raising=False)
    assert choose_model(f"{vendor}:x", options).missing == ()
    assert vendor not in sys.modules


def test_providers_of_others(options, tmp_path, monkeypatch):
    """An entry point of the group `tdac.providers` is a provider by its name."""
    info = tmp_path / "echo-1.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: echo\nVersion: 1\n")
    points = "[tdac.providers]\necho = echo_provider:make\nbroken = no_module:make\n"
    (info / "entry_points.txt").write_text(points)
    (tmp_path / "echo_provider.py").write_text(
        "from tdac_agent.provider import Reply\n"
        "class Echo:\n"
        "    paid = False\n"
        "    def __init__(self, words, options):\n"
        "        self.name = f'echo:{words}'\n"
        "    def complete(self, request):\n"
        "        return Reply(request.prompt)\n"
        "make = Echo\n"
    )
    monkeypatch.syspath_prepend(tmp_path)
    model = choose_model("echo:loud", options)
    assert model.name == "echo:loud"
    assert model.complete(QUESTION).text == QUESTION.prompt
    with pytest.raises(ProviderError, match=r"'broken' .* cannot be loaded"):
        choose_model("broken", options)
    with pytest.raises(ProviderError, match=r"SCRIPT, broken:…, echo:…$"):
        choose_model("other", options)


def test_learner_and_optimizer_are_one_where_they_are_named_so(small_task, tmp_path):
    """Two names that are equal stand for one provider, with one count of questions."""
    name = f"manual:{tmp_path / 'mail'}"
    first, second = choose_models(name, name, small_task.setting)
    assert first is second
    other, third = choose_models(name, "builtin", small_task.setting)
    assert other is not third
    shutil.rmtree(tmp_path / "mail")


@pytest.mark.slow_after(1)
@pytest.mark.parametrize(
    ("url", "safe"),
    [
        ("http://gpu.lan:8000/v1", False),
        ("http://localhost.evil.org/v1", False),
        ("http://127.0.0.1.evil.org/v1", False),
        ("http://10.0.0.7/v1", False),
        ("http://[2001:db8::1]:8000/v1", False),
        ("https://gpu.lan:8000/v1", True),
        ("http://localhost:11434/v1", True),
        ("http://127.0.0.1:8000/v1", True),
        ("http://[::1]:8000/v1", True),
    ],
)
@pytest.mark.parametrize("kind", ["openai", "anthropic"])
def test_a_key_goes_nowhere_unencrypted(kind, url, safe, options, monkeypatch):
    """But to this machine, or where it is said; before anything is begun."""
    variable = f"{kind.upper()}_API_KEY"
    told = f"the key in {variable} would go unencrypted to {url}: use https"
    served = replace(options, base_url=url)
    monkeypatch.delenv(variable, raising=False)
    assert told not in " ".join(missing_for(choose_model(f"{kind}:m", served)))
    monkeypatch.setenv(variable, "key-12345678")
    lines = missing_for(choose_model(f"{kind}:m", served))
    assert any(line.startswith(told) for line in lines) != safe
    allowed = replace(served, key_over_http=True)
    assert missing_for(choose_model(f"{kind}:m", allowed)) == ()
    if not safe:
        with pytest.raises(ProviderError, match="--key-over-http"):
            choose_model(f"{kind}:m", served).complete(QUESTION)


@pytest.mark.slow
def test_the_command_says_that_a_key_would_be_read(tdac, refused, good, monkeypatch):
    """Exit 2, one line, nothing sent; with the flag the server is looked for."""
    monkeypatch.setenv("OPENAI_API_KEY", "key-12345678")
    words = ["synth", "--task", good, "--learner", "openai:m", "--max-tokens", 0]
    words += ["--base-url", "http://gpu.invalid/v1", "--out", "run"]
    err = refused(*words)
    assert "would go unencrypted to http://gpu.invalid/v1: use https, unset" in err
    assert not Path("run").exists()
    code, _, err = tdac(*words, "--key-over-http")
    assert (code, err.count("\n")) == (3, 1)
    assert "no server answers at http://gpu.invalid/v1" in err
