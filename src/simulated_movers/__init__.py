"""What moves in a simulated world beside the robot: people, carts, other robots and doors; how they look and where they go.

`Crowd` moves all of them by a tick; `MovingParts` tell where beams meet them. It knows neither physics nor meshes: the world comes
in as `OpenGround`. Nothing here is random but by the generators that are handed in.
"""

from simulated_movers.asked import asked_movers
from simulated_movers.beams import MovingParts, joined_parts
from simulated_movers.crowd import Crowd, MoverError
from simulated_movers.drawn import drawn_movers
from simulated_movers.ground import OpenGround, RobotSeen
from simulated_movers.record import MOVERS_FILE, MoverRecord
from simulated_movers.shapes import Part
from simulated_movers.specification import MoverSpec, read_movers, specs_of

__all__ = [
    "MOVERS_FILE",
    "Crowd",
    "MoverError",
    "MoverRecord",
    "MoverSpec",
    "MovingParts",
    "OpenGround",
    "Part",
    "RobotSeen",
    "asked_movers",
    "drawn_movers",
    "joined_parts",
    "read_movers",
    "specs_of",
]
