"""Verification: runs a suite on a controller and reports the result."""
