"""Campaigns: learners × optimizers × tasks × settings × R runs, resumable."""
