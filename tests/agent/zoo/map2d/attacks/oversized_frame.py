# idea: the header of a frame of 4 GB
# profile: policy
# onto: frames.py
# fails: test_imports, test_reaches_goal
# error: misused the judge's channel.*a frame of
# why: the size is refused before anything is read
def policy(obs):
    write(HEADER.pack(0xFFFFFFFF, VALUE, 3))
    return 1.0, 1.0
