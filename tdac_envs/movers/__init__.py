"""Moving discs: what a user asks for, their state, and their motion in a step.

`spec` has the models of `movers=[...]`, `state` the arrays, `placing` draws and checks
the start of an episode, `motion` moves routes and bouncing discs. This package knows
occupied squares only through functions that it is given (`motion.moving`), as
`tdac_envs.drive.sliding` does; `tdac_envs.map2d.encounters` is where robot and movers
meet.

The motion of a mover within a step is piecewise linear. A step has three phases, all of
them compiled and without allocation:

1. *Plan*: each kind writes the pieces of its movers, `Movers.pieces[m]`, from
   `Movers.now[m]`, as if there were no robot. This alone depends on the kind.
2. *Meet*: `map2d.encounters` finds the first contact of the robot's exact arc with any
   piece. In block mode, it ends the pieces of a mover that touches the robot there.
3. *Stop*: `motion.stop` moves each mover to the end of its pieces, or to the time of the
   contact that ends the episode, and updates `Movers.now`.

A further kind (a crowd) needs
- a model in `spec.Spec` and an entry in `placing._PLACED`: a function that draws the
  start of an episode and fills `traits` and `now`;
- a function that plans all its movers at once, called by `motion.moving`'s `plan` after
  the other kinds. It has the signature of `plan`; for each of its movers m it calls
  `motion.begin_piece` for each change of velocity in the step (at most `MOST_PIECES`),
  and `motion.end_pieces` at last. `motion.advance_straight` does this for a mover that
  keeps its velocity until it touches a wall, and then stands.
- arrays of its own as further fields of `Movers`: `map2d.kernels._movers_at` follows the
  order of the fields.
`traits[m, KIND]` tells the kinds apart; the number of movers is `len(traits)`. Discs of
kinds that have been planned before are already in `pieces` when a crowd is planned.
"""
