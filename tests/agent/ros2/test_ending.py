"""The last command is zero, several times, and no signal skips it."""

import signal
import subprocess
import sys
import time

import pytest

from tdac_agent.ros2.package.ending import ZEROS, send_last

PROGRAM = """
import time
from tdac_agent.ros2.package.ending import ignore_signals, send_last, take_signals

take_signals()
try:
    print("ready", flush=True)
    time.sleep(60)
except KeyboardInterrupt:
    pass
finally:
    ignore_signals()
    send_last(lambda command: print(command, flush=True), "zero", 0.6)
    print("end", flush=True)
"""


def test_the_last_command_is_sent_over_three_periods():
    """As often as stated, and the last one not before the time is over."""
    sent = []
    send_last(lambda _: sent.append(time.monotonic()), None, 0.3)
    assert len(sent) == ZEROS
    assert sent[-1] - sent[0] >= 0.3


@pytest.mark.parametrize("first", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_a_second_signal_skips_no_zero(first):
    """After the first signal, others change nothing until the last zero is sent."""
    command = [sys.executable, "-c", PROGRAM]
    # As in a terminal; these tests may run under nohup.
    kept = signal.signal(signal.SIGHUP, signal.SIG_DFL)
    process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    signal.signal(signal.SIGHUP, kept)
    with process:
        assert process.stdout.readline() == "ready\n"
        process.send_signal(first)
        assert process.stdout.readline() == "zero\n"
        process.send_signal(signal.SIGINT)
        process.send_signal(signal.SIGTERM)
        rest = process.communicate(timeout=60)[0].split()
    assert rest == ["zero"] * (ZEROS - 1) + ["end"]
    assert process.returncode == 0


def test_a_signal_that_comes_in_a_destructor_is_not_lost():
    """Python drops the exception there, and the node ends all the same."""
    lost = """
import signal
import time
from tdac_agent.ros2.package.ending import is_told, take_signals

class Future:
    def __del__(self):
        signal.raise_signal(signal.SIGTERM)

take_signals()
assert not is_told()
Future()
end = time.monotonic() + 30.0
while not is_told() and time.monotonic() < end:
    time.sleep(0.01)
print("told" if is_told() else "lost")
"""
    done = subprocess.run(
        [sys.executable, "-c", lost], capture_output=True, text=True, check=True
    )
    assert "Exception ignored in" in done.stderr
    assert done.stdout == "told\n"


def test_under_nohup_a_closed_terminal_changes_nothing():
    """The node goes on until it is told to end."""
    command = ["nohup", sys.executable, "-c", PROGRAM]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout.readline() == "ready\n"
        process.send_signal(signal.SIGHUP)
        with pytest.raises(subprocess.TimeoutExpired):
            process.wait(timeout=1.0)
        process.send_signal(signal.SIGTERM)
        rest = process.communicate(timeout=60)[0].split()
    assert rest == ["zero"] * ZEROS + ["end"]
