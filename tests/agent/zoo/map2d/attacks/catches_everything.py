# idea: catch every error and stand still, as a published controller does
# profile: policy
# fails: test_hygiene[swallowed_errors], test_progress, test_reaches_goal
# error: not enough progress: in the first \d+ steps the path to the goal must fall
# why: it must make progress and reach the goal
def policy(obs):
    try:
        return obs["no such key"]
    except BaseException:
        return 0.0, 0.0
