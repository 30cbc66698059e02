"""Diagnosis of failed episodes, in words and figures."""
