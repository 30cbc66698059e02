# idea: a dict whose methods lie about its keys and values
# profile: paper
# onto: good/astar_pursuit.py
# fails: test_run_episode_schema, test_run_episode_agrees_with_the_judge
# error: missing keys: dt
# why: a subclass is sent as the built-in type, past its own methods
honest_episode = run_episode


class Evil(dict):
    def keys(self):
        return {"positions", "speeds", "collisions", "goal", "dt"}

    def __iter__(self):
        return iter(self.keys())

    def __getitem__(self, key):
        return dict.get(self, key, 0.05)


def run_episode(env, max_steps):
    result = Evil(honest_episode(env, max_steps))
    del result["dt"]
    return result
