"""What a judge can ask of a child, and what comes back."""

import pickle
import textwrap
import time

import numpy as np
import pytest

from tdac_agent.sandbox import (
    ControllerDied,
    ControllerError,
    ControllerProtocolError,
    ControllerTimeout,
    EnvRefusalError,
    Handle,
    Limits,
    SandboxError,
    best_tier,
    start,
)

CONTROLLER = textwrap.dedent(
    '''
    """A controller."""
    import math
    from dataclasses import dataclass
    from enum import IntEnum

    import numpy as np
    import sensors

    LOOKAHEAD = 40
    SPAN = np.float32(0.5)
    _HIDDEN = 1

    class OccMap2D:
        def __init__(self, cells):
            self.cells = cells

        def is_occupied(self, x, y):
            return bool(self.cells[y, x])

        def raw(self, x, y):
            return self.cells[y, x]

    @dataclass
    class Memory:
        count: int = 0

    memory = Memory()

    def width(map2d, scale=1):
        return map2d.cells.shape[1] * scale

    def numbers():
        yield from range(3)

    def consume(items):
        return list(items)

    def fail(x):
        return 1 / x

    def policy(obs):
        memory.count += 1
        return (0.25, -1)

    def run_episode(env, max_steps):
        observation, info = env.reset(seed=3)
        positions = [observation["pose"]]
        for _ in range(max_steps):
            observation, reward, done, cut, info = env.step((0.5, np.float32(1)))
            positions.append(observation["pose"])
            if done or cut:
                break
        env.close()
        return {"positions": positions, "info": info}

    print("loaded")
    '''
)
OBS = {
    "pose": np.array([1, 2, 3], np.float32),
    "ranges": np.full(18, 220, np.float32),
}


@pytest.fixture
def child(loaded):
    return loaded(CONTROLLER)


def test_load_names_what_the_controller_defines(launch):
    names = launch(CONTROLLER).load()
    assert names["OccMap2D"] == "type"
    assert names["policy"] == "function"
    assert names["LOOKAHEAD"] == "int"
    assert "_HIDDEN" not in names


def test_every_tier_runs_a_controller(loaded, tier):
    child = loaded(CONTROLLER, tier)
    assert child.tier == tier
    assert child.policy(OBS) == (0.25, -1)


def test_constants_keep_their_types(child):
    assert child.get("LOOKAHEAD") == 40
    assert type(child.get("SPAN")) is np.float32


def test_a_missing_name_is_an_error_of_the_controller(child):
    with pytest.raises(ControllerError, match="no attribute 'AXLE'") as caught:
        child.get("AXLE")
    assert caught.value.type_name == "AttributeError"


def test_objects_stay_in_the_child_and_are_used_by_handle(child):
    cells = np.array([[False, True]])
    map2d = child.call("OccMap2D", (cells,))
    assert map2d == Handle(0, "OccMap2D")
    assert child.call((map2d, "is_occupied"), (1, 0)) is True
    assert type(child.call((map2d, "raw"), (1, 0))) is np.bool_
    assert child.call("width", (map2d,), {"scale": 3}) == 6
    assert np.array_equal(child.get("cells", map2d), cells)


def test_functions_and_generators_are_handles(child):
    function = child.get("numbers")
    assert function.type_name == "function"
    numbers = child.call(function)
    assert numbers.type_name == "generator"
    assert child.call("consume", (numbers,)) == [0, 1, 2]


def test_a_handle_that_was_never_given_is_an_error(child):
    with pytest.raises(ControllerError, match="not a value"):
        child.call((Handle(99, "OccMap2D"), "is_occupied"), (0, 0))


def test_an_error_names_its_line_and_the_child_lives_on(child):
    with pytest.raises(ControllerError, match="division by zero") as caught:
        child.call("fail", (0,))
    line = CONTROLLER.splitlines().index("    return 1 / x") + 1
    assert caught.value.line == line
    assert caught.value.traceback == f"  line {line}, in fail: return 1 / x"
    assert caught.value.phase == "fail"
    assert child.call("fail", (2,)) == 0.5


def test_reset_is_optional(loaded, child):
    assert child.reset(OBS) is None
    other = loaded("seen = []\ndef reset(obs):\n    seen.append(len(obs))\n")
    other.reset(OBS)
    assert other.get("seen") == [2]


def test_the_judge_steps_the_env_of_run_episode(child):
    actions = []

    class Env:
        def reset(self):
            return OBS, {}

        def step(self, action):
            actions.append(action)
            return OBS, 0.0, len(actions) == 3, False, {"steps": len(actions)}

    result = child.run_episode(Env(), 10, 30.0)
    assert len(result["positions"]) == 4
    assert result["info"] == {"steps": 3}
    assert actions == [(0.5, np.float32(1))] * 3
    assert type(actions[0][1]) is np.float32
    assert child.get("LOOKAHEAD") == 40


def test_an_env_may_refuse_a_step(child):
    class Env:
        def reset(self):
            raise EnvRefusalError("call reset once")

    with pytest.raises(ControllerError, match=r"RuntimeError.*call reset once"):
        child.run_episode(Env(), 10, 30.0)


def test_a_failing_env_is_not_the_controllers_fault(child):
    class Env:
        def reset(self):
            raise KeyError("ours")

    with pytest.raises(KeyError, match="ours"):
        child.run_episode(Env(), 10, 30.0)
    with pytest.raises(SandboxError, match="has ended"):
        child.policy(OBS)


ENDLESS_LOOP = """
def run_episode(env, n):
    env.reset()
    while True: env.step(0)
"""


class EndlessEnv:
    """Takes some seconds a step, and never ends."""

    def __init__(self, seconds):
        self.seconds = seconds

    def reset(self):
        return OBS, {}

    def step(self, _):
        time.sleep(self.seconds)
        return OBS, 0.0, False, False, {}


@pytest.mark.slow
def test_the_time_of_run_episode_is_the_controllers_own(loaded):
    child = loaded(ENDLESS_LOOP)
    with pytest.raises(ControllerTimeout, match=r"run_episode .* 0.3 s"):
        child.run_episode(EndlessEnv(0.0), 10, 0.3)


def test_but_not_without_end(loaded):
    """The judge's own time is nobody's; a deadline holds whoever took it."""
    child = loaded(ENDLESS_LOOP)
    began = time.monotonic()
    with pytest.raises(ControllerTimeout, match="run_episode"):
        child.run_episode(EndlessEnv(0.05), 10, 60.0, began + 0.5)
    assert time.monotonic() - began < 30.0


def test_what_reset_returns_is_not_sent(loaded):
    """It need not be what the wire can carry."""
    child = loaded("def reset(obs):\n    return {(k,): 0 for k in range(20_000)}\n")
    assert child.reset(OBS) is None


@pytest.mark.parametrize("code", [137, 152])
def test_an_exit_code_is_no_signal(loaded, code):
    """Whatever shells make of it."""
    child = loaded(f"import os\ndef policy(obs):\n    os._exit({code})\n")
    with pytest.raises(ControllerDied, match=f"exit code {code} at policy"):
        child.policy(OBS)


def test_printing_is_kept_and_counted(child):
    usage = child.close()
    assert usage.output_head == "loaded\n"
    assert usage.output_bytes == 7
    assert usage.cpu_seconds > 0
    assert usage.max_rss_bytes > 1 << 20


def test_a_fault_is_final(loaded):
    child = loaded("import os\ndef policy(obs):\n    os._exit(3)\n")
    for _ in range(2):
        with pytest.raises(ControllerDied, match="exit code 3 at policy") as caught:
            child.policy(OBS)
    assert caught.value.status == 3
    assert child.close().status == 3


def test_a_fault_survives_a_process_pool():
    fault = ControllerError("KeyError", "'x'", 3, "  line 3", "policy")
    back = pickle.loads(pickle.dumps(fault))
    assert type(back) is ControllerError
    assert (str(back), back.line, back.phase) == (str(fault), 3, "policy")


def test_close_may_be_repeated_and_ends_the_use(child):
    assert child.close() is child.close()
    with pytest.raises(SandboxError, match="has ended"):
        child.policy(OBS)


def test_a_child_can_be_started_before_its_controller_is_known(workdir):
    with start() as child:
        child.copy_files(workdir, "import sensors\nR = sensors.RANGE\n")
        child.load()
        assert child.get("R") == 220


def test_a_child_without_a_controller_reports_it_missing():
    with start() as child, pytest.raises(ControllerError, match="FileNotFoundError"):
        child.load()


def test_a_large_source_is_refused(launch):
    with pytest.raises(ControllerError, match="200001 bytes"):
        launch("#" * 200_001)


def test_two_children_share_nothing(loaded):
    source = (
        "import os\n"
        "def policy(obs):\n"
        "    path = os.environ['TMPDIR'] + '/count'\n"
        "    seen = os.path.exists(path)\n"
        "    open(path, 'w').close()\n"
        "    return seen\n"
    )
    for _ in range(2):
        child = loaded(source)
        assert child.policy(OBS) is False
        assert child.policy(OBS) is True


def test_hashing_is_the_same_in_every_child(loaded):
    hashes = set()
    for _ in range(2):
        child = loaded("KEY = hash('goal')\n")
        hashes.add(child.get("KEY"))
    assert len(hashes) == 1


def test_a_result_too_large_for_the_wire_is_an_error(loaded):
    limits = Limits(frame_bytes=10_000)
    child = loaded(
        "import numpy as np\ndef policy(obs): return np.zeros(9999)", "auto", limits
    )
    with pytest.raises(ControllerError, match="too large"):
        child.policy(OBS)
    with pytest.raises(ControllerError, match="too large"):
        child.policy(OBS)


def test_an_argument_larger_than_a_pipe_arrives(child):
    cells = np.zeros((1500, 1500), bool)
    map2d = child.call("OccMap2D", (cells,))
    assert child.call("width", (map2d,)) == 1500


def test_only_numpy_and_the_standard_library_can_be_imported(loaded, tier):
    child = loaded("def attempt(name):\n    return __import__(name).__name__\n", tier)
    for name in ("json", "heapq", "decimal", "ctypes", "numpy.random", "sensors"):
        assert child.call("attempt", (name,)) == name.split(".")[0]
    for name in ("pytest", "cv2", "gymnasium", "tdac_agent", "tdac_envs", "pip"):
        with pytest.raises(ControllerError, match="ModuleNotFoundError"):
            child.call("attempt", (name,))


def test_messages_are_free_of_paths_and_addresses(loaded):
    source = (
        "import os\n"
        "def policy(obs):\n"
        "    raise ValueError(f'{os.getcwd()}/params.json {object()!r} \\x1b[31m')\n"
    )
    child = loaded(source)
    with pytest.raises(ControllerError) as caught:
        child.policy(OBS)
    assert caught.value.text.startswith("params.json <object object> ")
    assert "\x1b" not in caught.value.text


def test_a_syntax_error_names_its_line(launch):
    with pytest.raises(ControllerError, match="SyntaxError") as caught:
        launch("x = 1\ny = = 2\n").load()
    assert caught.value.line == 2


@pytest.mark.slow
@pytest.mark.parametrize(
    "forged",
    [
        "b'\\xff' * 100",
        "b'\\xff' * 9",
        "struct.pack('<IBI', 1, 32, 99) + b'N'",
        "struct.pack('<IBI', 1, 99, 2) + b'N'",
        "struct.pack('<IBI', 1, 33, 2) + b'N'",
        "struct.pack('<IBI', 1, 34, 3) + b'N'",
        "struct.pack('<IBI', 1, 32, 3) + b'?'",
        "2 * (struct.pack('<IBI', 1, 32, 3) + b'N')",
    ],
)
def test_frames_of_the_controllers_own_are_a_breach(loaded, forged):
    source = (
        "import os, struct\n"
        "def policy(obs):\n"
        "    for fd in range(3, 64):\n"
        "        try:\n"
        f"            os.write(fd, {forged})\n"
        "        except OSError: pass\n"
    )
    child = loaded(source)
    with pytest.raises(ControllerProtocolError, match="misused the judge's channel"):
        child.policy(OBS)


@pytest.mark.parametrize(
    "torn",
    ["b'\\x09'", "struct.pack('<IBI', 1000, 32, 3) + b's'"],
)
def test_a_torn_frame_is_a_timeout(loaded, torn):
    source = (
        "import os, struct, time\n"
        "def policy(obs):\n"
        "    for fd in range(3, 64):\n"
        "        try:\n"
        f"            os.write(fd, {torn})\n"
        "        except OSError: pass\n"
        "    while True: time.sleep(1)\n"
    )
    child = loaded(source)
    with pytest.raises(ControllerTimeout, match="policy"):
        child.policy(OBS, timeout=0.3)


def test_a_frame_that_trickles_in_is_a_timeout(loaded):
    source = (
        "import os, struct, time\n"
        "def policy(obs):\n"
        "    data = struct.pack('<IBI', 100000, 32, 3) + bytes(100000)\n"
        "    while True:\n"
        "        for fd in range(3, 64):\n"
        "            try: os.write(fd, data[:1])\n"
        "            except OSError: pass\n"
        "        data = data[1:]\n"
        "        time.sleep(0.01)\n"
    )
    child = loaded(source)
    with pytest.raises(ControllerTimeout, match="policy"):
        child.policy(OBS, timeout=0.4)


def test_an_unknown_tier_is_named_with_the_known_ones():
    with pytest.raises(SandboxError, match=r"auto, bubblewrap, .*got 'docker'"):
        start(tier="docker")


def test_the_best_tier_is_more_than_rlimits():
    assert best_tier().name != "rlimits"


@pytest.mark.parametrize("name", ["cpu_seconds", "memory_bytes", "call_seconds"])
def test_limits_are_above_zero(name):
    with pytest.raises(ValueError, match=f"expected {name} above 0, got 0"):
        Limits(**{name: 0})
