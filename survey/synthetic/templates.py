"""The kinds of house the demo's streets are built of. Each kind is built several times."""

from dataclasses import dataclass
from typing import Literal

from survey.synthetic.canvas import Colour

Wall = Literal["ashlar", "brick", "stucco", "timber", "rubble", "tiles"]
Ground = Literal["shop", "rustic", "arcade", "house", "garage"]
Roof = Literal["mansard", "tiles", "parapet", "cornice"]
Top = Literal["flat", "arch", "segment"]
Surround = Literal["none", "frame", "pediment", "keystone", "brick", "lintel"]


@dataclass(frozen=True, slots=True)
class Window:
    """A window's make. Metres; `panes` across and down; `shutters` None: it has none."""

    width_m: float
    height_m: float
    panes: tuple[int, int]
    frame: Colour = (226, 224, 214)
    top: Top = "flat"
    surround: Surround = "frame"
    shutters: Colour | None = None
    glass: Colour = (44, 52, 60)


@dataclass(frozen=True, slots=True)
class Template:
    """A kind of house: what all its copies share. Metres; floors are counted above the ground."""

    name: str
    wall: Wall
    colour: Colour
    trim: Colour
    bays: int
    bay_m: float
    floors: int
    floor_m: float
    ground_m: float
    ground: Ground
    window: Window
    roof: Roof
    roof_m: float
    accent: Colour
    balconies: tuple[int, ...] = ()
    railed: tuple[int, ...] = ()

    @property
    def width_m(self) -> float:
        return self.bays * self.bay_m + 0.8

    @property
    def height_m(self) -> float:
        return self.ground_m + self.floors * self.floor_m + self.roof_m


STONE, CREAM, WHITE = (214, 198, 166), (232, 220, 190), (230, 226, 218)

# fmt: off
TEMPLATES: tuple[Template, ...] = (
    Template(
        "haussmann", "ashlar", STONE, (222, 208, 178), 5, 2.5, 4, 3.3, 4.2, "shop",
        Window(1.15, 2.2, (2, 4), surround="keystone"), "mansard", 2.8, (36, 70, 58),
        balconies=(1, 4), railed=(2, 3),
    ),
    Template(
        "hotel", "ashlar", (222, 212, 190), (234, 226, 206), 4, 3.1, 3, 3.8, 4.6, "rustic",
        Window(1.3, 2.5, (2, 4), surround="pediment"), "mansard", 2.6, (64, 44, 36),
        balconies=(1,), railed=(2,),
    ),
    Template(
        "brick-lintel", "brick", (156, 84, 62), (214, 200, 170), 4, 2.7, 4, 3.1, 3.9, "shop",
        Window(1.25, 1.85, (2, 3), surround="lintel"), "cornice", 1.3, (28, 48, 92), railed=(1,),
    ),
    Template(
        "brick-arch", "brick", (176, 108, 74), (222, 208, 184), 3, 3.3, 3, 3.5, 4.2, "arcade",
        Window(1.6, 2.3, (3, 4), top="arch", surround="brick"), "parapet", 1.5, (60, 52, 46),
    ),
    Template(
        "timber", "timber", (228, 214, 184), (78, 50, 34), 5, 2.0, 3, 2.8, 3.3, "shop",
        Window(1.0, 1.35, (2, 3), frame=(88, 58, 40), surround="none"), "tiles", 3.0,
        (132, 40, 34),
    ),
    Template(
        "stucco-shutters", "stucco", (226, 190, 138), WHITE, 4, 2.9, 3, 3.1, 3.8, "house",
        Window(1.05, 1.75, (2, 3), shutters=(70, 104, 92)), "tiles", 1.9, (74, 98, 84),
    ),
    Template(
        "stucco-rose", "stucco", (214, 158, 138), CREAM, 3, 3.2, 4, 3.0, 3.8, "shop",
        Window(1.1, 1.8, (2, 2), top="segment", shutters=(150, 164, 178)), "cornice", 1.2,
        (120, 34, 52), railed=(2, 3, 4),
    ),
    Template(
        "rubble-villa", "rubble", (182, 150, 108), (196, 110, 78), 3, 3.4, 2, 3.4, 3.9, "house",
        Window(1.35, 2.0, (3, 3), top="segment", surround="brick"), "tiles", 3.2, (52, 66, 54),
    ),
    Template(
        "deco", "stucco", (220, 216, 204), (180, 172, 150), 3, 4.0, 4, 3.2, 4.0, "shop",
        Window(2.3, 1.7, (4, 2), frame=(52, 56, 58), surround="none"), "parapet", 1.4,
        (22, 66, 84), balconies=(1, 2, 3, 4),
    ),
    Template(
        "faience", "tiles", (92, 138, 142), (222, 212, 182), 4, 2.8, 3, 3.3, 4.1, "shop",
        Window(1.3, 2.1, (2, 3), top="arch", surround="frame"), "parapet", 1.6, (152, 112, 44),
        railed=(1, 2),
    ),
    Template(
        "flemish", "brick", (134, 62, 52), (226, 222, 206), 4, 2.2, 3, 3.1, 3.7, "house",
        Window(1.05, 2.0, (2, 5), surround="keystone"), "mansard", 3.4, (34, 62, 44),
    ),
    Template(
        "workshop", "brick", (168, 126, 92), (92, 96, 98), 3, 4.1, 2, 3.7, 4.4, "garage",
        Window(2.7, 2.4, (6, 5), frame=(54, 62, 60), top="segment", surround="brick"), "cornice",
        1.4, (62, 84, 88),
    ),
    Template(
        "civic", "ashlar", (206, 200, 184), (224, 220, 206), 5, 2.9, 2, 4.1, 4.6, "arcade",
        Window(1.3, 2.6, (2, 5), top="arch", surround="frame"), "parapet", 1.8, (70, 60, 44),
        balconies=(1,),
    ),
    Template(
        "modest", "stucco", (206, 204, 192), (190, 180, 160), 4, 2.4, 3, 2.8, 3.6, "shop",
        Window(1.0, 1.6, (2, 3), surround="lintel", shutters=(196, 190, 176)), "tiles", 1.7,
        (168, 128, 36),
    ),
    Template(
        "pierre-de-taille", "ashlar", (226, 206, 170), (236, 220, 190), 3, 3.6, 4, 3.2, 4.1,
        "rustic", Window(1.7, 2.1, (4, 4), top="segment", surround="keystone"), "cornice", 1.2,
        (58, 48, 40), railed=(1, 2, 3, 4),
    ),
    Template(
        "bank", "ashlar", (188, 186, 178), (208, 206, 198), 3, 3.8, 3, 3.6, 5.0, "arcade",
        Window(1.5, 2.3, (2, 2), surround="pediment", frame=(70, 64, 52)), "parapet", 2.0,
        (48, 56, 52),
    ),
    Template(
        "cottage-timber", "timber", (214, 176, 128), (58, 44, 40), 3, 2.9, 2, 2.9, 3.4, "house",
        Window(1.5, 1.4, (4, 3), frame=(232, 226, 210), surround="none"), "tiles", 3.6,
        (60, 78, 104),
    ),
    Template(
        "glazed-white", "tiles", (216, 214, 204), (58, 92, 120), 5, 2.3, 4, 2.9, 3.8, "shop",
        Window(1.1, 1.7, (1, 3), surround="frame", frame=(58, 74, 86)), "cornice", 1.4,
        (38, 82, 118), balconies=(2, 4),
    ),
    Template(
        "meuliere-tall", "rubble", (196, 172, 134), (222, 208, 178), 4, 2.7, 4, 3.0, 3.8, "shop",
        Window(1.1, 1.8, (2, 4), surround="lintel"), "mansard", 2.5, (94, 44, 40), railed=(1, 3),
    ),
    Template(
        "yellow-stock", "brick", (190, 158, 102), (236, 230, 216), 5, 2.4, 3, 3.2, 4.0, "house",
        Window(1.1, 2.0, (2, 4), top="arch", surround="frame"), "parapet", 1.3, (24, 40, 74),
        balconies=(1,),
    ),
)
# fmt: on
