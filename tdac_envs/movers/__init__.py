"""Moving discs: what a user asks for, their state, and their motion in a step.

`spec` has the models of `movers=[...]`, `state` the arrays and the pieces of a motion,
`motion` moves routes and bouncing discs, `crowd` moves people: by `orca`, between
`places`, around `walls`. This package knows occupied squares only
through functions that it is given (`motion.moving`), as `tdac_envs.drive.sliding` does.
In `tdac_envs.map2d`, `starts` and `placing` draw and check the start of an episode,
robot and movers meet in `encounters`, and `among` is the step.

The motion of a mover within a step is piecewise linear. A step has three phases, all of
them compiled and without allocation:

1. *Plan*: each kind writes the pieces of its movers, `Movers.pieces[m]`, from
   `Movers.now[m]`, as if there were no robot. Only this depends on the kind.
2. *Meet*: the first contact of the robot's exact arc with any piece is found. In block
   mode, a mover that touches the robot stands from there on (`state.hold`).
3. *Stop*: `state.stop` moves each mover to the end of its pieces, or to the time of
   the contact that ends the episode, and updates `Movers.now`.

A further kind needs
- a model in `spec.KINDS`, and a `Start` in `map2d.starts`, whose `place` draws where a
  mover starts, with the random numbers of the episode. No mover may touch the robot,
  standing at its start, for 2 s: `placing` draws a start again if it would;
- a function that plans all its movers at once and is called in
  `map2d.among._drive_among` after `plan`, where the robot's arrays are at hand, and
  which skips the movers of other kinds (`traits[m, KIND]`). For each of its movers m it
  calls `state.begin_piece` for each change of velocity in the step, in rows 0, 1, ...
  (at most `MOST_PIECES`), and `state.end_pieces` at last. `advance_straight` (made by
  `motion.moving`, at hand in `map2d.encounters`) does the first for a mover that keeps
  its velocity up to the first contact with a wall;
- `traits[m, SPEED]` as the largest speed that such a mover ever has: it bounds what is
  in reach;
- arrays of its own as further fields of `Movers`: `map2d.among.movers_at` follows the
  order of the fields.
Pieces of movers of other kinds are already planned at that time. `now` has the
velocities of all movers at the end of the last step. `stop` updates `now` for every
kind; its last column is what a kind remembers from step to step.
"""
