# idea: write a file in ways that are not open()
# profile: policy
# onto: good/policy_minimal.py
# fails: only test_hygiene[file_writes]
# error: dump.*open_memmap.*write_text.*
# why: each function of NumPy and pathlib that writes is named
import re

try:
    STEPS.dump("steps.pickle")
    np.lib.format.open_memmap("x.npy", mode="w+", shape=(1,))
    sensors.Path("x").write_text("x")
    sensors.Path("x").open("w")
except OSError as error:
    STEPS.flags.writeable = bool(re.match("x", str(error)))
