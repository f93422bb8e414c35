"""The window of the drive: what it shows, drawn with pygame."""

import os
from collections.abc import Sequence
from itertools import pairwise
from math import atan2, cos, degrees, hypot, radians, sin
from typing import NamedTuple

from ..drawing.palette import FAINT, GRID, GROUND, HULL, PANEL, TEXT, TRAIL, WARNING, WINDOW_JETS
from ..drawing.shapes import jets, outline
from ..model.craft import Craft
from ..model.dynamics import Controls
from .camera import Camera, Point
from .gates import Course

os.environ.setdefault("PYGAME_HIDE_SUPPORT_PROMPT", "1")
try:
    import pygame as pygame  # the drive's loop takes it from here, with these messages
except ImportError as error:
    raise ModuleNotFoundError(
        "the window needs pygame-ce, which is not installed: "
        "pip install 'hovercraft-fmu[drive]', in a checkout '.[drive]'"
    ) from error
if not getattr(pygame, "IS_CE", False):
    raise ModuleNotFoundError(
        "the window needs pygame-ce, in whose place pygame is installed, of the same name: "
        "pip uninstall -y pygame pygame-ce, then pip install 'hovercraft-fmu[drive]', in a checkout '.[drive]'"
    )

SIZE = (1280, 720)
"""pixels, at the start"""
VIEW_LENGTHS = 16
"""So many times the craft fits across the window, at the start."""
BAR = 96
"""pixels: the instruments, below the view"""
UNSEEN = ("dummy", "offscreen")
"""SDL's video drivers without a window."""
TRAIL_POINTS = 600
TRAIL_SPACING = 5.0
"""pixels"""
HELP = (
    ("up, down", "more thrust, less thrust: 1 N/s while held"),
    ("right, left", "turn to starboard, to port: a bow thruster while held"),
    ("W A S D", "the same, as the arrows"),
    ("I J K L", "wind: 0.1 m/s more up, left, down, right each second held"),
    ("C", "calm: no wind"),
    ("G", "a course of gates, and a clock that the first one starts"),
    ("F", "the view follows the craft, or stands still and wraps"),
    ("+  -", "time runs twice as fast, half as fast"),
    ("space", "pause"),
    ("R", "reset: back to the start, a new record"),
    ("H", "this help"),
    ("Esc", "end"),
)
HINT = "arrows drive   G gates   F follow   IJKL wind   space pause   R reset   + - time   H help   Esc end"


class Frame(NamedTuple):
    """What one frame shows."""

    time: float
    """s"""
    pose: tuple[float, float, float]
    """x, y [m], heading [rad]"""
    speed: float
    """m/s"""
    controls: Controls
    scale: float
    """simulated seconds a second"""
    paused: bool = False
    help: bool = False
    notes: Sequence[str] = ()
    """What is to be told: warnings."""
    course: Course | None = None


def check_display() -> None:
    """So that no FMU need be built or loaded to learn that there is no display. Raises OSError."""
    try:
        pygame.display.init()
        driver = pygame.display.get_driver()
        pygame.display.quit()
    except pygame.error as error:
        raise OSError(f"no window can be opened, is there a display? {error}") from error
    if driver in UNSEEN and "SDL_VIDEODRIVER" not in os.environ:  # SDL's last resort, unless it is asked for
        raise OSError(f"no window can be opened, is there a display? SDL found none but {driver!r}")


def _open(title: str) -> None:
    check_display()
    try:
        pygame.display.init()
        pygame.display.set_caption(title)
        pygame.display.set_mode(SIZE, pygame.RESIZABLE)
    except pygame.error as error:
        raise OSError(f"no window can be opened, is there a display? {error}") from error


class Window:
    """The window, and the trail in it.

    Raises OSError where no window can be opened.
    """

    def __init__(self, craft: Craft, title: str) -> None:
        self._craft, self._title = craft, title
        pygame.font.init()
        _open(title)
        self._small, self._large = pygame.font.Font(None, 20), pygame.font.Font(None, 34)
        self._scale = SIZE[0] / (VIEW_LENGTHS * max(craft.length, craft.width))
        self._trail: list[Point] = []
        self.follows = False
        """Whether the view goes with the craft."""

    @staticmethod
    def close() -> None:
        """It is gone."""
        pygame.quit()

    def camera(self, here: Point) -> Camera:
        """Of the window as large as it is now, with the craft here [m]."""
        width, height = self._screen.get_size()
        return Camera(width, max(height - BAR, 1), self._scale, here if self.follows else None)

    @property
    def _screen(self) -> "pygame.Surface":
        screen = pygame.display.get_surface()
        if screen is None:
            raise OSError("the window is gone")
        return screen

    def clear(self) -> None:
        """No trail."""
        self._trail.clear()

    def draw(self, shown: Frame) -> None:
        """One frame, on the screen."""
        here = (shown.pose[0], shown.pose[1])
        screen, camera = self._screen, self.camera(here)
        screen.fill(PANEL)
        view = screen.subsurface((0, 0, camera.width, min(camera.height, screen.get_height())))
        view.fill(GROUND)
        self._draw_grid(view, camera)
        self._draw_trail(view, camera, here)
        if shown.course:
            self._draw_gates(view, camera, shown.course)
        self._draw_craft(view, camera, shown)
        self._draw_instruments(screen, shown)
        self._draw_words(view, shown)
        pygame.display.flip()

    # ---- the view

    def _draw_grid(self, view: "pygame.Surface", camera: Camera) -> None:
        spacing = self._craft.length * camera.scale
        x, y = camera.place(0.0, 0.0)
        x, y = (x % spacing, y % spacing) if camera.followed else (x, y)
        for i in range(-int(x / spacing), int((camera.width - x) / spacing) + 1):
            pygame.draw.line(view, GRID, (x + i * spacing, 0), (x + i * spacing, camera.height))
        for i in range(-int(y / spacing), int((camera.height - y) / spacing) + 1):
            pygame.draw.line(view, GRID, (0, y + i * spacing), (camera.width, y + i * spacing))

    def _draw_trail(self, view: "pygame.Surface", camera: Camera, here: Point) -> None:
        trail = self._trail
        if not trail or hypot(here[0] - trail[-1][0], here[1] - trail[-1][1]) * camera.scale >= TRAIL_SPACING:
            trail.append(here)
            del trail[:-TRAIL_POINTS]
        points = [*trail, here]
        for i, (a, b) in enumerate(pairwise(points)):
            x, y = camera.place(*a)
            right, down = camera.scale * (b[0] - a[0]), camera.scale * (b[1] - a[1])
            if max(abs(right), abs(down)) > camera.height:
                continue  # faster than the view can tell
            color = pygame.Color(GROUND).lerp(TRAIL, (i + 1) / len(points))
            for start, end in camera.copies([(x, y), (x + right, y + down)]):
                pygame.draw.aaline(view, color, start, end, 2)

    def _draw_gates(self, view: "pygame.Surface", camera: Camera, course: Course) -> None:
        """Port is red and starboard green, as at sea; the next gate is bright."""
        for i, (posts, is_ahead) in enumerate(course.posts):
            for port, starboard in camera.copies([camera.place(*post) for post in posts]):
                if is_ahead:
                    pygame.draw.aaline(view, TEXT if i == course.next else FAINT, port, starboard, 2)
                for point, name in ((port, "port"), (starboard, "starboard")):
                    pygame.draw.aacircle(view, WINDOW_JETS[name] if is_ahead else GRID, point, 6)

    def _draw_craft(self, view: "pygame.Surface", camera: Camera, shown: Frame) -> None:
        for points in camera.copies(camera.body(shown.pose, outline(self._craft))):
            pygame.draw.polygon(view, HULL, points)
            pygame.draw.aalines(view, HULL, True, points)
        applied = shown.controls
        for name, corners in jets(self._craft, applied.thrust, applied.port, applied.starboard).items():
            for points in camera.copies(camera.body(shown.pose, corners)):
                pygame.draw.polygon(view, WINDOW_JETS[name], points)
                pygame.draw.aalines(view, WINDOW_JETS[name], True, points)

    # ---- the words

    def _draw_words(self, view: "pygame.Surface", shown: Frame) -> None:
        self._write(view, self._title, (16, 14), FAINT)
        self._write(view, f"a square is {self._craft.length:g} m", (view.get_width() - 16, 14), FAINT, right=True)
        for i, note in enumerate(shown.notes):
            self._write(view, note, (16, 40 + 22 * i), WARNING)
        if shown.course:
            words = f"{shown.course.words}   {shown.course.clock(shown.time):.1f} s"
            self._write(view, words, (view.get_width() - 16, 40), TEXT, self._large, right=True)
        if shown.paused:
            self._write(view, "PAUSED", (view.get_width() / 2 - 48, 14), TEXT, self._large)
        if shown.help:
            self._draw_help(view)

    def _draw_help(self, view: "pygame.Surface") -> None:
        panel = pygame.Surface((620, 40 + 30 * len(HELP)), pygame.SRCALPHA)
        panel.fill((6, 34, 47, 230))
        for i, (key, meaning) in enumerate(HELP):
            self._write(panel, key, (24, 24 + 30 * i), WARNING)
            self._write(panel, meaning, (150, 24 + 30 * i), TEXT)
        view.blit(panel, ((view.get_width() - 620) / 2, (view.get_height() - panel.get_height()) / 2))

    def _draw_instruments(self, screen: "pygame.Surface", shown: Frame) -> None:
        top = screen.get_height() - BAR
        heading = degrees(shown.pose[2]) % 360.0
        wind = hypot(shown.controls.wind_x, shown.controls.wind_y)
        self._draw_thrust(screen, (24, top), shown.controls.thrust)
        self._draw_value(
            screen, (300, top), "speed", f"{shown.speed:.2f} m/s" if shown.speed < 1e4 else f"{shown.speed:.3g} m/s"
        )
        self._draw_value(screen, (480, top), "heading", f"{heading:.0f} deg")
        self._draw_arrow(screen, (616, top + 40), shown.pose[2], HULL)
        self._draw_value(screen, (680, top), "wind", f"{wind:.2f} m/s")
        if wind > 0.0:
            self._draw_arrow(screen, (826, top + 40), atan2(shown.controls.wind_y, shown.controls.wind_x), TRAIL)
        self._draw_value(screen, (900, top), "time", f"{shown.time:.1f} s")
        self._draw_value(screen, (1090, top), "runs at", f"{shown.scale:g} x")
        self._write(screen, HINT, (24, top + 74), FAINT)

    def _draw_thrust(self, screen: "pygame.Surface", place: tuple[int, int], thrust: float) -> None:
        low, high = self._craft.thrust_min, self._craft.thrust_max
        width, span = 140, (high - low) or 1.0
        self._draw_value(screen, place, "thrust", f"{thrust:.1f} N")
        x, y = place[0] + 108, place[1] + 36
        pygame.draw.rect(screen, GRID, (x, y, width, 16), border_radius=4)
        zero, end = (x + width * (min(max(each, low), high) - low) / span for each in (0.0, thrust))
        pygame.draw.rect(screen, WINDOW_JETS["thrust"], (min(zero, end), y, abs(end - zero), 16), border_radius=4)

    def _draw_value(self, screen: "pygame.Surface", place: tuple[int, int], name: str, text: str) -> None:
        self._write(screen, name, (place[0], place[1] + 12), FAINT)
        self._write(screen, text, (place[0], place[1] + 34), TEXT, self._large)

    def _draw_arrow(self, screen: "pygame.Surface", place: Point, angle: float, color: str) -> None:
        """On a dial."""
        pygame.draw.aacircle(screen, GRID, place, 26, 2)
        tips = [(22.0, 0.0), (-14.0, radians(40.0)), (-8.0, 0.0), (-14.0, radians(-40.0))]
        points = [(place[0] + r * cos(angle + a), place[1] + r * sin(angle + a)) for r, a in tips]
        pygame.draw.polygon(screen, color, points)
        pygame.draw.aalines(screen, color, True, points)

    def _write(
        self, surface: "pygame.Surface", text: str, place: Point, color: str, font: "pygame.font.Font | None" = None,
        right: bool = False,
    ) -> None:  # fmt: skip
        image = (font or self._small).render(text, True, color)
        surface.blit(image, (place[0] - image.get_width() if right else place[0], place[1]))
