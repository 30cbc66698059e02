"""Judged episodes: driving, recording and drawing."""
