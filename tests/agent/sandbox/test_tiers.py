"""Which tiers there are, what they promise, and that a judge's end is theirs."""

import os
import signal
import subprocess
import sys
import textwrap
import threading
from pathlib import Path

import pytest

import tdac_agent
from tdac_agent.sandbox import (
    TIERS,
    Limits,
    SandboxError,
    Tier,
    available_tiers,
    best_tier,
    start,
)
from tdac_agent.sandbox.inner import syscalls
from tdac_agent.sandbox.launch import start_blank
from tdac_agent.sandbox.tiers import ALL_PROMISES

ROOT = str(Path(next(iter(tdac_agent.__path__))).parent)


def test_every_tier_is_reported_with_a_reason_where_it_does_not_work():
    statuses = available_tiers()
    assert [status.tier for status in statuses] == list(TIERS)
    for status in statuses:
        assert status.works == (status.reason == "")
    assert statuses[-1].withdrawn == (
        "hides_files",
        "hides_names",
        "denies_network",
        "denies_processes",
    )


@pytest.mark.skipif(sys.platform != "linux", reason="the better tiers are Linux's")
def test_on_linux_a_tier_works_that_promises_everything():
    working = [status.tier for status in available_tiers() if status.works]
    assert working[0].promises != ()
    assert best_tier() == working[0]


def test_a_missing_bubblewrap_is_the_reason(monkeypatch):
    monkeypatch.setenv("PATH", "/nonexistent")
    with pytest.raises(SandboxError, match=r"bwrap.* is not installed"):
        start(tier="bubblewrap")


@pytest.mark.parametrize("step", ["namespaces", "landlock", "seccomp"])
def test_what_the_kernel_refuses_is_said_in_one_line(step):
    # A child that is already filtered can do none of these any more.
    tier = Tier("nested", ("seccomp", step), ALL_PROMISES)
    with pytest.raises(SandboxError, match=r"^nested: .*Operation not permitted$"):
        start_blank(tier, Limits())


def test_a_missing_temporary_folder_is_a_fault_of_the_sandbox(monkeypatch):
    monkeypatch.setattr("tempfile.tempdir", "/nonexistent")
    with pytest.raises(SandboxError, match="cannot start a child"):
        start(tier="rlimits")


def test_lower_limits_of_the_user_are_kept(tmp_path):
    script = (
        "import resource; resource.setrlimit(resource.RLIMIT_NOFILE, (40, 40));"
        "from tdac_agent.sandbox import start; start(tier='rlimits').close()"
    )
    environment = {**os.environ, "PYTHONPATH": ROOT}
    subprocess.run([sys.executable, "-c", script], check=True, env=environment)


def test_a_broken_bubblewrap_says_what_it_printed(monkeypatch, tmp_path):
    program = tmp_path / "bwrap"
    program.write_text("#!/bin/sh\necho no namespaces for you >&2\nexit 1\n")
    program.chmod(0o755)
    monkeypatch.setenv("PATH", f"{tmp_path}:/bin:/usr/bin")
    with pytest.raises(SandboxError, match="no namespaces for you"):
        start(tier="bubblewrap")


def test_a_tier_that_does_not_confine_is_refused(monkeypatch, tmp_path):
    program = tmp_path / "bwrap"
    program.write_text(
        '#!/bin/sh\nwhile [ "$1" != -- ]; do shift; done\nshift\nexec "$@"\n'
    )
    program.chmod(0o755)
    monkeypatch.setenv("PATH", f"{tmp_path}:/bin:/usr/bin")
    with pytest.raises(SandboxError, match="promises not kept: hides_names"):
        start(tier="bubblewrap")


@pytest.mark.parametrize("machine", syscalls.MACHINES)
def test_no_process_socket_or_rights_call_is_in_the_table(machine):
    names = {row.split()[0] for row in syscalls.ALLOWED.replace("\n", " ").split(",")}
    forbidden = (
        "clone clone3 fork vfork execve execveat socket socketpair connect bind ptrace "
        "unshare setns mount symlink symlinkat link linkat chmod fchmod chown setsid "
        "setpgid setrlimit prctl seccomp io_uring_setup memfd_create bpf kcmp tkill "
        "process_vm_readv process_vm_writev pidfd_open pidfd_send_signal flock "
        "rt_sigqueueinfo rt_tgsigqueueinfo close_range shmget mknod "
        "mknodat open_by_handle_at"
    )
    assert not names & set(forbidden.split())
    numbers = syscalls.allowed(machine) + list(syscalls.guarded(machine).values())
    assert len(numbers) == len(set(numbers))


@pytest.mark.parametrize("machine", syscalls.MACHINES)
def test_no_call_leaves_a_note_for_the_next_child(machine):
    """None moves pages of shared files, tells what is free, or counts inodes up."""
    names = {row.split()[0] for row in syscalls.ALLOWED.replace("\n", " ").split(",")}
    notes = (
        "fadvise64 readahead mincore cachestat madvise process_madvise preadv2 "
        "pwritev2 mlock mlock2 sync sync_file_range syncfs statfs fstatfs sysinfo pipe "
        "pipe2 eventfd2 timerfd_create epoll_create1 inotify_init1 mq_open semget "
        "msgget add_key keyctl sched_getscheduler clock_gettime getpgid getpriority"
    )
    assert not names & set(notes.split())
    guarded = {"madvise", "clock_gettime", "getpgid", "getpriority"}
    assert guarded <= syscalls.guarded(machine).keys()


@pytest.mark.slow
def test_what_numpy_and_malloc_ask_for_is_allowed(launch, tier):
    """Advice on its own memory, its own clocks, and its own processors."""
    source = """
        import mmap, os, time
        import numpy as np
        def policy(obs):
            large = np.ones((1500, 1500))
            room = mmap.mmap(-1, 1 << 22)
            room.madvise(mmap.MADV_DONTNEED)
            room.madvise(mmap.MADV_HUGEPAGE)
            time.sleep(0)
            return (
                float((large @ large)[0, 0]), time.process_time() > 0,
                time.thread_time() > 0, os.getpgid(0) == os.getpgrp(),
                bool(os.sched_getaffinity(0)), os.getpriority(os.PRIO_PROCESS, 0),
            )
    """
    with launch(textwrap.dedent(source), tier) as child:
        child.load()
        own = os.getpriority(os.PRIO_PROCESS, 0)
        assert child.policy({}) == (1500.0, True, True, True, True, own)


JUDGE = """
    import sys
    from tdac_agent.sandbox import start
    child = start(None, "def policy(obs):\\n    while True: pass\\n", tier=sys.argv[1])
    child.load()
    print(child.pid, flush=True)
    child.policy({}, timeout=60)
"""


@pytest.mark.slow_after(1)
def test_a_child_ends_with_its_killed_judge(tier, tmp_path, wait_until_gone):
    end_judge(tier, tmp_path, signal.SIGKILL, wait_until_gone)


def test_an_interrupted_judge_leaves_nothing(tmp_path, wait_until_gone):
    end_judge("auto", tmp_path, signal.SIGINT, wait_until_gone)
    assert list(tmp_path.iterdir()) == []


def end_judge(tier, tmp_path, number, wait_until_gone):
    judge = subprocess.Popen(
        [sys.executable, "-c", textwrap.dedent(JUDGE), tier],
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        env={**os.environ, "TMPDIR": str(tmp_path), "PYTHONPATH": ROOT},
    )
    with judge:
        pid = int(judge.stdout.readline())
        judge.send_signal(number)
        judge.wait(10)
    assert wait_until_gone(pid, tmp_path) == []


def test_a_forgotten_child_ends(tier, wait_until_gone):
    child = start(tier=tier)
    pid = child.pid
    del child
    assert wait_until_gone(pid, f"/nonexistent/{pid}") == []


def test_a_child_outlives_the_thread_that_started_it(tier):
    children = []
    thread = threading.Thread(target=lambda: children.append(start(tier=tier)))
    thread.start()
    thread.join()
    with children[0] as child:
        child.copy_files(None, "def policy(obs): return obs\n")
        child.load()
        assert child.policy(1) == 1
