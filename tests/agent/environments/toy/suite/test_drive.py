"""What a controller of the toy environment must do."""


def test_reaches_the_goal(rollout):
    """It arrives from the nominal start, and from a moved one."""
    assert rollout("nominal").reached
    assert rollout("jitter 1").reached
