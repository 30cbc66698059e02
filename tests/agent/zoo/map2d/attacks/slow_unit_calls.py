# idea: answer each unit call just in time, so that the suite takes an hour
# profile: paper
# onto: good/astar_pursuit.py
# limits: cpu_seconds=6
# fails: test_is_occupied_inside
# error: limit of . s of CPU time|used more than . s of CPU time|did not end within
# why: CPU time is bounded over all processes of a verification, wall time too
class OccMap2D(OccMap2D):
    def is_occupied(self, x, y):
        until = CLOCK() + 0.2
        while self.width == 37 and CLOCK() < until:
            continue
        return super().is_occupied(x, y)


from time import process_time as CLOCK
