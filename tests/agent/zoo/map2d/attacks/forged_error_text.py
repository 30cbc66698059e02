# idea: an error frame with a text that no report can hold
# profile: policy
# onto: frames.py
# fails: test_imports, test_short_rollout_is_stable[10], test_reaches_goal
# error: misused the judge's channel at policy: a string that is too long
# why: what an exception says is bounded and printable, or the channel is broken
def text(value):
    data = value.encode("utf-8", "surrogatepass")
    return b"s" + struct.pack("<I", len(data)) + data


def policy(obs):
    parts = text("ValueError") + text("\ud800\x1b]0;owned\x07") + text("")
    error = b"e" + struct.pack("<I", 1) + parts
    write(HEADER.pack(len(error), ERROR, 4) + error)
    while True:  # nothing of the own server follows
        pass
