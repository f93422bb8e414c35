"""What moving pictures draw beside the outline of the craft."""

from collections.abc import Mapping

from ..model.craft import Craft

Shape = list[tuple[float, float]]
"""Corners in the body frame [m]."""


def jets(craft: Craft, thrust: float, port: float, starboard: float) -> Mapping[str, Shape]:
    """The air that is blown out, as triangles; the stronger the push [N; 1; 1], the longer. Reverse blows forward."""
    stern, bow, side = -0.5 * craft.length, 0.5 * craft.length, 0.5 * craft.width
    full = max(abs(craft.thrust_min), abs(craft.thrust_max)) or 1.0
    root, wide, reach = 0.06 * craft.length, 0.5 * side, 0.9 * craft.width
    triangles = {
        "thrust": [(stern, -wide), (stern, wide), (stern - 0.7 * craft.length * thrust / full, 0.0)],
        "port": [(bow - root, -side), (bow + root, -side), (bow, -side - reach * port)],
        "starboard": [(bow - root, side), (bow + root, side), (bow, side + reach * starboard)],
    }
    return {name: triangles[name] for name, push in zip(triangles, (thrust, port, starboard), strict=True) if push}
