"""Writes, reads, resumes and replays run folders."""
