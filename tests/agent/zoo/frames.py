"""Put before an attack on the channel: its descriptors, and well-formed frames."""

import os
import struct


def descriptors():
    """Everything open but the standard ones: the two channels and the lifeline."""
    found = []
    for number in range(3, 64):
        try:
            os.fstat(number)
        except OSError:
            continue
        found.append(number)
    return found


def write(data):
    """Writes to each of them that can be written to."""
    for number in descriptors():
        try:
            os.write(number, data)
        except OSError:
            continue


HEADER = struct.Struct("<IBI")
VALUE, ERROR, ENV_STEP = 32, 33, 35
WHEELS = b"t\x02\x00\x00\x00f" + struct.pack("<d", 1.0) + b"f" + struct.pack("<d", 1.0)
