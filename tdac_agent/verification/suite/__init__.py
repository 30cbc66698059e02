"""What a suite tests with: contract, oracles, references."""
