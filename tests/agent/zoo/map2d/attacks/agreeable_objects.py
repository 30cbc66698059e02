# idea: results whose entries compare equal to everything and have any length
# profile: paper
# onto: good/astar_pursuit.py
# fails: test_run_episode_schema, test_run_episode_agrees_with_the_judge
# why: no object crosses the channel; what is not plain data becomes a name for it
class Agreeable:
    def __eq__(self, other):
        return True

    def __len__(self):
        return 51

    def __float__(self):
        return 0.05

    def __iter__(self):
        return iter([0.0, 0.0])


def run_episode(env, max_steps):
    obs, _ = env.reset()
    for _ in range(max_steps):
        env.step((0.0, 0.0))
    return dict.fromkeys(("positions", "speeds", "collisions", "goal", "dt"), Agreeable())
