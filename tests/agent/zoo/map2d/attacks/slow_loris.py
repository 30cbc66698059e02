# idea: a frame, byte by byte and second by second
# profile: policy
# onto: frames.py
# limits: call_seconds=2
# fails: test_imports, test_reaches_goal
# error: policy did not end within 2 s
# why: the deadline is the whole frame's
def policy(obs):
    import select

    for byte in HEADER.pack(len(WHEELS), VALUE, 3) + WHEELS:
        write(bytes([byte]))
        select.select([], [], [], 0.5)
