# idea: break every built-in function
# profile: policy
# fails: test_imports, test_reaches_goal
# why: only the child has them
import builtins


def broken(*args, **kwargs):
    raise KeyError("patched")


def policy(obs):
    for name in ("len", "isinstance", "open", "print", "type", "getattr", "range"):
        setattr(builtins, name, broken)
    return 1.0, 1.0
