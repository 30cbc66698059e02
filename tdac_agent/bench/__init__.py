"""The arena: entrants of every kind on the same worlds of task sets.

`entrants` finds what the user names, `bench` has it driven, `record` is the results
file, `compared` its statistics.
"""
