"""Executors: they distribute jobs over worker processes or a Ray cluster.

`executor` is their interface; `local` and `on_ray` execute the runs of a campaign and
the drives of a bench.
"""
