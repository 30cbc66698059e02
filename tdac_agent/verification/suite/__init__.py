"""Parts of the verification suites: contract, oracles and references."""
