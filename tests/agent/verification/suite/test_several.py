"""All independent assertions of a test that fail are reported at once."""

import pytest

from tdac_agent.environments.map2d.builtin import MapParameters, template_for
from tdac_agent.verification.suite.several import Several
from tdac_agent.verification.verify import verify


def test_what_fails_is_collected():
    """Each message once, a few of many; other errors end the test as usual."""
    several = Several()
    several.settle()
    for number in (1, 2, 2, 3, 4, 5, 6):
        with several:
            assert number == 0, f"no. {number}"
    with pytest.raises(AssertionError, match=r"^no\. 1; no\. 2; .*4; and 2 more$"):
        several.settle()
    with pytest.raises(KeyError), several:
        raise KeyError


@pytest.mark.slow
def test_feedback_names_every_wrong_entry(small_task, warm):
    """Of `run_episode`: with where to read what is wanted; of constants: each."""
    robot = small_task.params.robot
    source = template_for(robot, small_task.nominal.dt).render(MapParameters())
    wrong = source.replace(f"N_RAYS = {robot.n_rays}", "N_RAYS = 7")
    wrong = wrong.replace("SENSOR_FOV_DEG = ", "SENSOR_FOV_DEG = 1 + ")
    wrong += (
        "\n\n_own_loop = run_episode\n\n\ndef run_episode(env, max_steps):\n"
        "    result = _own_loop(env, max_steps)\n"
        "    return {**result, 'collisions': 7, 'dt': 9.0}\n"
    )
    report = verify(wrong, small_task, profile="paper", paper=True, judge=warm)
    told = {f.test.rpartition("::")[2]: f.message for f in report.failures}
    assert "N_RAYS = 7" in told["test_robot_constants"]
    assert "SENSOR_FOV_DEG = " in told["test_robot_constants"]
    message = told["test_run_episode_agrees_with_the_judge"]
    assert 'return info["collisions"] of the last step' in message
    assert "dt is 9.0, not 0.05" in message
