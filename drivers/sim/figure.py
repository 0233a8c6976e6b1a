"""Paints whole people, as flat figures that are stood in the world like cardboard cut-outs."""

from drivers.sim.canvas import Canvas, Points, Sprite, mirrored, oval
from drivers.sim.face import mixed, paint_back_of_head, paint_hair_behind, paint_head
from drivers.sim.looks import Look

MILLIMETRE = 0.001
"""Metres to a pixel of a figure."""

HALF_WIDTH = 340
"""Half the width of a figure in millimetres: room for shoulders and arms."""

CROWN = 170
"""Millimetres from the eyes to the top of a figure: room for hair."""

_DARK = (20, 16, 18)


def paint_figure(look: Look, height: float, *, from_behind: bool = False) -> Sprite:
    """Paint somebody whose eyes are ``height`` metres above the floor.

    The sheet is one millimetre to the pixel; its lower edge is the floor, and the point between the eyes is
    ``CROWN`` pixels below its upper edge, in the middle.
    """
    floor = round(height / MILLIMETRE)
    canvas = Canvas(-HALF_WIDTH, -CROWN, HALF_WIDTH, floor)
    _legs(canvas, look, floor)
    _arms(canvas, look, floor)
    paint_hair_behind(canvas, look)
    _neck(canvas, look)
    _torso(canvas, look, floor)
    if from_behind:
        paint_back_of_head(canvas, look)
    else:
        paint_head(canvas, look)
    return canvas.sprite()


def _neck(canvas: Canvas, look: Look) -> None:
    canvas.fill(mirrored([(0, 80), (54, 80), (56, 150), (92, 196), (0, 220)]), mixed(look.skin, _DARK, 0.14), soft=2)
    canvas.shade(oval(0, 124, 62, 26), _DARK, soft=11, strength=0.42)


def _torso(canvas: Canvas, look: Look, floor: int) -> None:
    hip = 0.48 * floor
    body: Points = mirrored(
        [(0, 206), (62, 182), (110, 178), (196, 214), (214, 280), (180, 380), (164, hip - 110), (172, hip + 40)]
    )
    canvas.fill(body, look.shirt, soft=2)
    for side in (-1.0, 1.0):
        canvas.shade(oval(side * 200, hip * 0.6, 46, hip * 0.5), _DARK, soft=26, strength=0.35)
        canvas.shade(oval(side * 70, 330, 62, 70), mixed(look.shirt, (255, 255, 255), 0.3), soft=40, strength=0.3)
    canvas.shade(oval(0, hip + 20, 190, 60), _DARK, soft=30, strength=0.25)


def _arms(canvas: Canvas, look: Look, floor: int) -> None:
    wrist = 0.53 * floor
    sleeve = mixed(look.shirt, _DARK, 0.14)
    for side in (-1.0, 1.0):
        arm = [(side * x, y) for x, y in [(150, 206), (206, 220), (234, 300), (262, wrist), (210, wrist), (172, 320)]]
        canvas.fill(oval(side * 240, wrist + 48, 27, 60), look.skin, soft=2)
        canvas.fill(arm, sleeve, soft=3)
        canvas.shade([(side * 214, 260), (side * 250, wrist), (side * 240, wrist)], _DARK, soft=10, strength=0.3)


def _legs(canvas: Canvas, look: Look, floor: int) -> None:
    hip, shade = 0.46 * floor, mixed(look.trousers, _DARK, 0.35)
    for side in (-1.0, 1.0):
        leg = [(side * x, y) for x, y in [(0, hip), (166, hip), (158, floor - 60), (62, floor - 60), (8, hip + 130)]]
        canvas.fill(leg, look.trousers, soft=2)
        canvas.shade([(side * 150, hip), (side * 166, hip), (side * 158, floor - 60)], shade, soft=14, strength=0.8)
        canvas.fill(oval(side * 116, floor - 34, 58, 32), mixed(_DARK, look.trousers, 0.2), soft=2)
