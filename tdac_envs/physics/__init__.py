"""Physics: what moves a robot's body for one control step, and says what it touched.

A physics knows nothing of tasks, rewards and observations. `moved.Physics` is the
protocol; `engine.MujocoBody` moves the body with MuJoCo, a 3D contact solver.
"""
