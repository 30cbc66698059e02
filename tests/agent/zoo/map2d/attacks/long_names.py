# idea: names with so many dots that to write them down takes the square of it
# profile: policy
# repeat: 450 ;numpy
#     ._os._os._os._os._os._os._os._os._os._os._os._os._os._os._os._os._os._os._os._os
#     ._os._os._os._os._os._os._os._os._os._os._os._os._os._os._os._os._os._os._os._os
#     ._os._os._os._os._os._os._os._os._os._os._os._os._os._os._os._os._os._os._os._os
#     ._os._os._os._os._os._os._os._os._os._os._os._os._os._os._os._os._os._os._os._os
#     ._os._os._os._os._os._os._os._os._os._os._os._os._os._os._os._os._os._os._os._os
# fails: test_imports, test_reaches_goal
# error: use of numpy\._os
# why: the beginning of a name and its first hidden module say enough
import numpy


def policy(obs):
    return 1.0, 1.0


0
