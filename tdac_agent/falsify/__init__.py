"""The smallest deviation with which a controller fails: `tdac falsify`."""
