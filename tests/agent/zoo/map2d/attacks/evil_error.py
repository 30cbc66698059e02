# idea: an error that breaks whoever prints it
# profile: policy
# fails: test_reaches_goal, test_no_collisions
# error: Evil at policy
# why: an error is described in the child, and what breaks there is left out
class Meta(type):
    __name__ = property(lambda cls: 1 / 0)


class Evil(Exception, metaclass=Meta):
    def __str__(self):
        raise SystemExit

    __repr__ = __str__
    __class__ = property(__str__)


def policy(obs):
    raise Evil
