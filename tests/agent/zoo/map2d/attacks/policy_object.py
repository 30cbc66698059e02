# idea: a callable object for a policy
# profile: policy
# onto: good/policy_minimal.py
# fails: only test_policy_is_defined
# error: no `def policy
# why: a plain function is asked for
class Policy:
    def __init__(self, steer):
        self.steer = steer

    def __call__(self, obs):
        return self.steer(obs)


steer = policy
policy = Policy(steer)
