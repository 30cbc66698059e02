"""Files, locks and journals that survive a crash."""
