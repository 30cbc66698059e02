"""Judged episodes: who drives, what is recorded, how it is drawn."""
