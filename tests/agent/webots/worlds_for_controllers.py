"""Texts of small worlds."""

HEAD = "#VRML_SIM R2025a utf8\nWorldInfo { basicTimeStep 32 }\nViewpoint { }\n"
ARENA = "RectangleArena { floorSize 1.4 1 }\n"
SLOTS = """  turretSlot [ GPS { } Compass { } InertialUnit { } ]
  groundSensorsSlot [ E-puckGroundSensors { } ]
"""
GOAL = """DEF GOAL Solid {
  translation 0.4 0 0.001
  children [ Shape { geometry Cylinder { height 0.002 radius 0.02 } } ]
  name "GOAL"
}
"""
BOX = """DEF BOX WoodenBox {
  translation 0 0 0.05
  rotation 0 0 1 0.3
  name "box"
  size 0.1 0.2 0.1
}
"""


def epuck(place="-0.4 0 0", angle=0.0, supervisor=True, more=""):
    """An e-puck that looks along x."""
    return (
        f"DEF EPUCK E-puck {{\n  translation {place}\n  rotation 0 0 1 {angle}\n"
        f'  controller "mine"\n  supervisor {str(supervisor).upper()}\n'
        f"{SLOTS}{more}}}\n"
    )


OPEN = HEAD + ARENA + epuck() + GOAL
"""The way to the goal is free."""
BLOCKED = HEAD + ARENA + epuck() + GOAL + BOX
"""A box is in the way."""
NO_GOAL = HEAD + ARENA + epuck("-0.4 0.2 0", 0.4) + BOX
PLAIN = HEAD + ARENA + epuck(supervisor=False) + GOAL
"""The robot is no supervisor."""
LINE = (
    HEAD
    + ARENA
    + epuck("-0.5 -0.1 0", 0.25)
    + """Solid {
  translation 0 0 0.0005
  rotation 0 0 1 0.2
  children [
    Shape {
      appearance PBRAppearance { baseColor 0 0 0 roughness 1 metalness 0 }
      geometry Box { size 1.1 0.012 0.001 }
    }
  ]
  name "line"
}
"""
)
NUE = """#VRML_SIM R2023b utf8
WorldInfo { basicTimeStep 16 coordinateSystem "NUE" }
E-puck {
  translation 0.1 0 0.3
  rotation 1 0 0 -1.5707963267949
  supervisor TRUE
  turretSlot [ GPS { } Compass { } InertialUnit { } ]
}
"""
"""y is up; the robot looks along x."""
