# idea: leave the nominal episode's actions behind, and replay them in the next one
# profile: policy
# onto: good/policy_minimal.py
# tiers: every
# fails: test_imports
# error: import of 'os'
# error rlimits: found a record in
# harm rlimits: file written
# why: a fresh process and an empty scratch folder for each episode
import os
import sys

PLACES = [".", os.environ["HOME"], "@TARGET@"]
FOUND = [place for place in PLACES if os.path.exists(f"{place}/replay")]
FOUND += ["sys"] * hasattr(sys, "replay")
sys.replay = []
honest = policy


def keep(place):
    try:
        with open(f"{place}/replay", "w") as file:
            file.write(repr(sys.replay))
    except OSError as error:
        return error


def policy(obs):
    if FOUND:
        raise ValueError(f"found a record in {FOUND}")
    sys.replay.append(honest(obs))
    if len(sys.replay) == 30:
        for place in PLACES:
            keep(place)
    return sys.replay[-1]
