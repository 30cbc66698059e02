# idea: raise KeyboardInterrupt
# profile: policy
# fails: test_reaches_goal, test_no_collisions
# error: KeyboardInterrupt at policy
# why: it is an error of the controller, not the user's key
def policy(obs):
    raise KeyboardInterrupt
