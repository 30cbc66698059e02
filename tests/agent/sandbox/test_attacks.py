"""What a hostile controller tries, on every tier, and how each attempt ends."""

import os
import textwrap
from pathlib import Path

import numpy as np
import pytest

from tdac_agent.sandbox import (
    ControllerDied,
    ControllerError,
    ControllerOutputFlood,
    ControllerProtocolError,
    ControllerTimeout,
    Limits,
)
from tdac_agent.sandbox.inner import syscalls, wire

PATIENT = Limits(import_seconds=30, call_seconds=30)
SHORT = Limits(import_seconds=0.5, call_seconds=0.5)
OBS = {"pose": np.zeros(3, np.float32)}


def loaded(launch, tier, source, limits=PATIENT):
    child = launch(textwrap.dedent(source), tier, limits)
    child.load()
    return child


# What ends the process is tried on each tier, what Python itself reports on one.
FATAL = ("os._exit", "hard exit", "endless", "crash", "memory", "quiet flood")
IMPORTS = {
    "a syntax error": ("def f(:", ControllerError, "SyntaxError"),
    "a null byte": ("x = 1\0", ControllerError, "SyntaxError|ValueError"),
    "not utf-8": (b"x = '\xff'", ControllerError, "SyntaxError"),
    "an error": ("1 / 0", ControllerError, "ZeroDivisionError at import .line 1"),
    "a missing module": ("import torch", ControllerError, "torch"),
    "sys.exit": ("import sys; sys.exit(0)", ControllerError, "SystemExit at import"),
    "os._exit": ("import os; os._exit(0)", ControllerDied, "exit code 0 at import"),
    "interrupt": ("raise KeyboardInterrupt", ControllerError, "KeyboardInterrupt"),
    "endless": ("while True: pass", ControllerTimeout, "import did not end within 0.5"),
    "sleeping": ("import time; time.sleep(99)", ControllerTimeout, "import"),
    "crash": ("import ctypes; ctypes.string_at(0)", ControllerDied, "SIGSEGV"),
    "recursion": ("def f(): f()\nf()", ControllerError, "RecursionError"),
    "memory": ("x = bytearray(50 << 30)", ControllerError, "MemoryError"),
    "an evil error": (
        "class E(Exception):\n    def __str__(self): raise SystemExit\nraise E",
        ControllerError,
        "E at import",
    ),
}


def on_tiers(cases, on_every_tier):
    """Return parameters: some cases on each tier, the rest on the best one."""
    return [name for name in cases if (name in FATAL) == on_every_tier]


@pytest.mark.slow_after(2)
@pytest.mark.parametrize("name", on_tiers(IMPORTS, True))
def test_an_import_that_fails_on_each_tier(launch, tier, name):
    check_import(launch, tier, name)


@pytest.mark.slow_after(3)
@pytest.mark.parametrize("name", on_tiers(IMPORTS, False))
def test_an_import_that_fails(launch, name):
    check_import(launch, "auto", name)


def check_import(launch, tier, name):
    source, fault, match = IMPORTS[name]
    limits = SHORT if fault is ControllerTimeout else PATIENT
    with pytest.raises(fault, match=match):
        launch(source, tier, limits).load()


CALLS = {
    "endless": ("while True: pass", ControllerTimeout, "policy did not end"),
    "exit": ("import sys; sys.exit()", ControllerError, "SystemExit at policy"),
    "hard exit": ("import os; os._exit(7)", ControllerDied, "exit code 7 at policy"),
    "recursion": ("return policy(obs)", ControllerError, "RecursionError"),
    "deep value": (
        "a = []\n    for _ in range(9999): a = [a]\n    return a",
        ControllerError,
        "nested deeper",
    ),
    "memory": (
        "import numpy as np; return np.ones(50 << 27)",
        ControllerError,
        "MemoryError",
    ),
    "many objects": (
        "return [object() for _ in range(20000)]",
        ControllerError,
        "10000",
    ),
    "flood": (
        "\n    while True: print('x' * 10000)",
        ControllerOutputFlood,
        "printed more than 1048576 bytes at policy",
    ),
    "quiet flood": (
        "import os\n    while True: os.write(2, b'x' * 9999)",
        ControllerOutputFlood,
        "printed more",
    ),
}


@pytest.mark.slow_after(2)
@pytest.mark.parametrize("name", on_tiers(CALLS, True))
def test_a_call_that_fails_on_each_tier(launch, tier, name):
    check_call(launch, tier, name)


@pytest.mark.parametrize("name", on_tiers(CALLS, False))
def test_a_call_that_fails(launch, name):
    check_call(launch, "auto", name)


def check_call(launch, tier, name):
    body, fault, match = CALLS[name]
    limit = 0.5 if name == "endless" else 30
    child = loaded(launch, tier, f"def policy(obs):\n    {body}\n")
    with pytest.raises(fault, match=match):
        child.policy(OBS, timeout=limit)


@pytest.mark.slow_after(1)
def test_cpu_time_is_limited(launch, tier):
    child = loaded(
        launch,
        tier,
        "import signal\ndef policy(obs):\n    while True: pass\n",
        Limits(cpu_seconds=1, call_seconds=60),
    )
    with pytest.raises(ControllerDied, match="CPU time"):
        child.policy(OBS)


@pytest.mark.slow_after(1)
def test_cpu_time_counts_though_the_child_has_ended_itself(launch, tier):
    source = """
        import os, time
        def policy(obs):
            while time.process_time() < 0.5: pass
            os._exit(0)
    """
    child = loaded(launch, tier, source, Limits(call_seconds=30))
    with pytest.raises(ControllerDied, match="exit code 0"):
        child.policy(OBS)
    assert child.close().cpu_seconds >= 0.4


PROCESSES = """
    import os, subprocess, sys, threading

    def fork():
        while True: os.fork()

    def daemon():
        if os.fork() == 0:
            os.setsid()
            if os.fork() == 0:
                while True: pass

    def program(): subprocess.run([sys.executable or "/bin/sh", "-c", "1"], check=True)
    def spawn(): os.posix_spawn("/proc/self/exe", ["x"], {})
    def replace(): os.execv("/bin/sh", ["sh"])
    def thread(): threading.Thread(target=print).start()
    def leave_session(): os.setsid()
    def kill_all(): os.kill(-1, 9)
    def kill_group(): os.killpg(0, 9)
    def kill_judge(pid): os.kill(pid, 9)
    def kill_parent(): os.kill(os.getppid(), 9)
    def loosen():
        import resource
        resource.setrlimit(resource.RLIMIT_CPU, (1, 1))
"""


DENIED = ("fork", "daemon", "program", "spawn", "replace", "thread", "leave_session")
DENIED += ("kill_all", "kill_group", "kill_judge", "kill_parent", "loosen")
REFUSALS = {"PermissionError", "BlockingIOError", "RuntimeError", "ValueError"}


def test_processes_and_signals_are_denied(launch, tier):
    child = loaded(launch, tier, PROCESSES)
    for name in DENIED:
        arguments = (os.getpid(),) if name == "kill_judge" else ()
        with pytest.raises(ControllerError) as caught:
            child.call(name, arguments)
        assert caught.value.type_name in REFUSALS, name


def test_there_is_no_network(launch, promising_tier):
    source = """
        import socket
        FAMILIES = [socket.AF_INET, socket.AF_INET6, socket.AF_UNIX, socket.AF_NETLINK]
        def attempt(kind):
            socket.socket(FAMILIES[kind // 2], kind % 2 + 1)
        def pair(): socket.socketpair()
        def look_up(): socket.create_connection(("127.0.0.1", 80))
    """
    child = loaded(launch, promising_tier, source)
    for kind in range(8):
        with pytest.raises(ControllerError, match="PermissionError"):
            child.call("attempt", (kind,))
    for name in ("pair", "look_up"):
        with pytest.raises(ControllerError, match="PermissionError"):
            child.call(name)


# x86_64 and aarch64: clone, ptrace, mount, unshare, io_uring_setup, bpf, keyctl,
# memfd_create, process_vm_readv, setns, symlinkat, open_by_handle_at, personality.
RAW = {
    "x86_64": (56, 101, 165, 272, 425, 321, 250, 319, 310, 308, 266, 304, 135),
    "aarch64": (220, 117, 40, 97, 425, 280, 219, 279, 270, 268, 36, 265, 92),
}


def test_raw_system_calls_are_denied(launch, promising_tier):
    machine = os.uname().machine
    if machine not in RAW:
        pytest.skip(machine)
    source = """
        import ctypes
        libc = ctypes.CDLL(None, use_errno=True)
        def attempt(number):
            result = libc.syscall(ctypes.c_long(number), *[ctypes.c_long(0)] * 6)
            return result, ctypes.get_errno()
    """
    child = loaded(launch, promising_tier, source)
    for number in RAW[machine]:
        assert child.call("attempt", (number,)) == (-1, 1)
        assert number not in syscalls.allowed(machine)


def test_the_environment_holds_no_secret(launch, tier, monkeypatch):
    monkeypatch.setenv("ANTHROPIC_API_KEY", "canary-in-the-environment")
    child = loaded(launch, tier, "import os\ndef policy(obs): return dict(os.environ)")
    environment = child.policy(OBS)
    assert set(environment) <= {
        "HOME",
        "TMPDIR",
        "LANG",
        "OMP_NUM_THREADS",
        "OPENBLAS_NUM_THREADS",
        "PYTHONHASHSEED",
        "LD_LIBRARY_PATH",
        "PWD",
    }
    assert "canary" not in repr(environment)


READ = "def read(path):\n    with open(path, 'rb') as file: return file.read(100)\n"


def test_files_outside_are_hidden(launch, promising_tier, tmp_path):
    canary = tmp_path / "canary"
    canary.write_text("secret")
    pid = os.getpid()
    child = loaded(launch, promising_tier, READ)
    for path in (
        canary,
        "/etc/passwd",
        "/etc/hostname",
        Path.home() / ".bashrc",
        f"/proc/{pid}/environ",
        f"/proc/{pid}/cmdline",
        f"/proc/{pid}/root/etc/passwd",
        "/proc/self/environ",
        "/proc/self/mem",
        "/dev/mem",
        __file__,
        np.__file__.replace("numpy/__init__", "pytest/__init__"),
    ):
        with pytest.raises(ControllerError, match=r"FileNotFoundError|PermissionError"):
            child.call("read", (str(path),))
    assert child.call("read", ("params.json",)) == b"{}"


LISTING = """
    import os

    def entries(path):
        try:
            return os.listdir(path)
        except OSError:
            return []
"""


def test_folders_outside_are_hidden(launch, promising_tier, tmp_path):
    (tmp_path / "canary").write_text("secret")
    child = loaded(launch, promising_tier, LISTING)
    assert "canary" not in child.call("entries", (str(tmp_path),))
    for path in ("/etc/ssl", "/home", "/var", "/opt", "/root/.ssh", "/proc", "/sys"):
        assert child.call("entries", (path,)) == []


def test_folders_on_the_way_to_visible_ones_are_hidden(launch, promising_tier):
    """Their names differ from run to run, and tell where this machine has its files.

    A judge has its temporary folder below that of the machine, where a virtual
    environment may be as well.
    """
    child = loaded(launch, promising_tier, LISTING)
    for path in ("/", "/tmp", *map(str, child.folder.root.parents)):
        assert child.call("entries", (path,)) == []


WRITES = """
    import os

    def create(path):
        with open(path, "w") as file: file.write("x")

    def append(path):
        with open(path, "a") as file: file.write("x")

    def remove(path): os.remove(path)
    def rename(path): os.rename(path, path + ".old")
    def truncate(path): os.truncate(path, 0)
    def chmod(path): os.chmod(path, 0o777)
    def link(path): os.symlink("/etc/passwd", path + ".link")
    def folder(path): os.mkdir(path + ".d")
"""


def test_nothing_but_scratch_can_be_written(launch, promising_tier, workdir):
    child = loaded(launch, promising_tier, WRITES)
    names = ("create", "append", "remove", "rename", "truncate", "chmod", "link")
    for path in ("controller.py", "params.json", "sensors.py", wire.__file__):
        for attempt in (*names, "folder"):
            with pytest.raises(ControllerError, match=r"PermissionError|OSError"):
                child.call(attempt, (path,))
    assert (workdir / "params.json").read_text() == "{}"


SCRATCH = """
    import os, tempfile

    def look(): return os.listdir(os.environ["TMPDIR"])

    def use():
        with tempfile.TemporaryDirectory() as folder:
            path = os.path.join(folder, "a")
            with open(path, "w") as file: file.write("kept")
            os.rename(path, path + "b")
            with open(path + "b") as file: return file.read()

    def fill():
        size = 0
        for number in range(10):
            with open(f"{os.environ['TMPDIR']}/{number}", "wb") as file:
                file.write(bytes(1 << 20))
            size += 1 << 20
        return size

    def bury():
        os.chdir(os.environ["TMPDIR"])
        # 8000 characters of path, twice what a system call takes.
        for _ in range(40):
            os.mkdir("d" * 200, 0o700)
            os.mkdir("lifted-7", 0o000)
            os.chdir("d" * 200)

    def link(): os.symlink("/etc/passwd", os.environ["TMPDIR"] + "/link")

    def open_many():
        return [open(f"{os.environ['TMPDIR']}/{n}", "w") for n in range(1000)]
"""


def test_scratch_is_empty_and_writable(launch, tier):
    child = loaded(launch, tier, SCRATCH)
    assert child.call("look") == []
    assert child.call("use", timeout=5) == "kept"


def test_scratch_is_bounded(launch, tier):
    limits = Limits(
        scratch_bytes=(4 << 20) if tier in {"bubblewrap", "namespaces"} else 1000
    )
    child = loaded(launch, tier, SCRATCH, limits)
    with pytest.raises(ControllerError, match="OSError"):
        child.call("fill")


def test_scratch_is_removed_however_deep(launch, tier):
    loaded(launch, tier, SCRATCH).call("bury")


def test_links_cannot_be_made_in_scratch(launch, tier):
    with pytest.raises(ControllerError, match="PermissionError"):
        loaded(launch, tier, SCRATCH).call("link")


def test_descriptors_are_bounded(launch, tier):
    with pytest.raises(ControllerError, match="Too many open files"):
        loaded(launch, tier, SCRATCH).call("open_many")


@pytest.mark.slow_after(1)
def test_closing_the_channel_is_noticed(launch, tier):
    child = loaded(
        launch,
        tier,
        "import os\ndef policy(obs):\n    os.closerange(3, 64)\n    while True: pass\n",
    )
    with pytest.raises(
        ControllerProtocolError, match=r"misused the judge's channel.*closed it"
    ):
        child.policy(OBS)


def test_closing_the_output_changes_nothing(launch, tier):
    source = "import os\nos.close(1); os.close(2)\ndef policy(obs): return 1.0, 1.0\n"
    child = launch(source, tier)
    child.load()
    for _ in range(3):
        assert child.policy(OBS) == (1.0, 1.0)
    assert child.close().cpu_seconds > 0


def test_patched_builtins_harm_only_the_child(launch, tier):
    source = """
        import builtins, json, os, sys
        def broken(*args, **kwargs): raise KeyError("patched")
        for name in ("len", "isinstance", "open", "print", "dict", "type", "getattr"):
            setattr(builtins, name, broken)
        for module in list(sys.modules.values()):
            if module.__name__.startswith("inner."):
                for name in list(vars(module)):
                    if name[:2] != "__": setattr(module, name, broken)
        def policy(obs): return 1.0, 1.0
    """
    child = launch(textwrap.dedent(source), tier, SHORT)
    with pytest.raises((ControllerError, ControllerDied, ControllerTimeout)):
        child.load()
