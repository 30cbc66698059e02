# idea: a well-formed object whose name the own server would never send
# profile: policy
# onto: frames.py
# also: epuck
# fails: test_imports, test_short_rollout_is_stable[10], test_reaches_goal
# error: misused the judge's channel at policy: a string that is too long
# why: names are bounded and printable, or the channel is broken
def policy(obs):
    name = "\ud800\x1b[2J".encode("utf-8", "surrogatepass")
    handle = b"h" + struct.pack("<I", 0) + b"s" + struct.pack("<I", len(name)) + name
    write(HEADER.pack(len(handle), VALUE, 4) + handle)
    while True:  # nothing of the own server follows
        pass
