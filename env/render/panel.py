"""Text around the field: header with score and time, legend."""

from __future__ import annotations

import pygame
from steerclear.env.render.arena import Arena
from steerclear.env.render.canvas import font
from steerclear.env.render.scene import Scene, closest_pair
from steerclear.env.render.theme import Colour, Theme
from steerclear.shield.foreign import visible

HEADER_PX = 62
STEERING = "you: ringed   ahead ↑ W   turn ← → A D   back ↓ S   half speed Shift   stop: no key"
"""What the keys do, as `steerclear.policies` reads them."""

MOST_LETTERS = 200
"""Of a line; what is longer fits in no picture."""
FOOTER_PX = 40
TEAM_NAMES = ("BLUE", "RED")


def draw_text(
    surface: pygame.Surface,
    text: str,
    at_px: tuple[float, float],
    colour: Colour,
    size_px: int = 15,
    bold: bool = False,
    anchor: str = "midleft",
) -> pygame.Rect:
    """Write one line.

    Args:
        surface: The finished picture.
        text: What to write.
        at_px: Where.
        colour: Of the text.
        size_px: Of the letters.
        bold: Heavy letters.
        anchor: Point of the text that lies at ``at_px``, one of pygame's names for a rectangle's points.

    Returns:
        The rectangle written to.
    """
    image = font(size_px, bold).render(visible(text)[:MOST_LETTERS], True, colour)
    box = image.get_rect()
    setattr(box, anchor, (round(at_px[0]), round(at_px[1])))
    surface.blit(image, box)
    return box


def draw_header(surface: pygame.Surface, scene: Scene, arena: Arena, theme: Theme, margin_px: int) -> None:
    """Write teams, score and time above the field."""
    width, middle = surface.get_width(), HEADER_PX / 2
    for team, side in ((0, 1), (1, -1)):
        edge = margin_px if side > 0 else width - margin_px
        anchor = "midleft" if side > 0 else "midright"
        score = str(int(scene.captures[team]))
        box = draw_text(surface, score, (edge, middle), theme.team[team], 40, True, anchor)
        beside = box.right + 14 if side > 0 else box.left - 14
        draw_text(surface, TEAM_NAMES[team], (beside, middle - 10), theme.team[team], 17, True, anchor)
        draw_text(surface, _what_plays(arena, team), (beside, middle + 12), theme.muted, 14, False, anchor)
    minutes, seconds = divmod(scene.time_s + 1e-9, 60.0)
    clock = f"{int(minutes):02d}:{seconds:04.1f}" if seconds < 59.95 else f"{int(minutes) + 1:02d}:00.0"
    draw_text(surface, clock, (width / 2, middle - 9), theme.ink, 27, True, "center")
    pair = closest_pair(scene, arena)
    closest = "" if pair is None else f"closest pair {pair[2]:.1f} m"
    line = "  ·  ".join(part for part in (arena.title, closest) if part)
    colour = theme.breach if pair is not None and pair[2] <= arena.separation_m else theme.muted
    draw_text(surface, line, (width / 2, middle + 17), colour, 14, False, "center")


def _what_plays(arena: Arena, team: int) -> str:
    covered = any(arena.team[k] == team and name in arena.shielded for k, name in enumerate(arena.names))
    parts = [arena.policies[team], "shield on" if covered else ""]
    return "  ·  ".join(part for part in parts if part)


def draw_legend(surface: pygame.Surface, arena: Arena, theme: Theme, margin_px: int) -> None:
    """Explain the marks below the field."""
    y = surface.get_height() - FOOTER_PX / 2
    x = float(margin_px)
    if arena.steered:
        x = draw_text(surface, STEERING, (x, y), theme.ink, 14, True).right + 26
    entries = (
        ("arrow", theme.wanted, 2, "wanted by the policy"),
        ("arrow", theme.changed, 5, "sent by the shield instead"),
        ("ring", theme.muted, 2, f"discs touch = closer than {arena.separation_m:g} m"),
        ("ring", theme.breach, 3, "breach"),
        ("cross", theme.ink, 2, "tagged"),
    )
    for kind, colour, width, text in entries:
        if x + 32 + font(14).size(text)[0] > surface.get_width() - margin_px:
            break
        _draw_key(surface, kind, (x + 12, y), colour, width)
        x = draw_text(surface, text, (x + 32, y), theme.muted, 14).right + 26
    scale = f"grid 10 m   ·   {arena.bounds_m[0]:g} × {arena.bounds_m[1]:g} m"
    if x < surface.get_width() - margin_px - font(14).size(scale)[0]:
        draw_text(surface, scale, (surface.get_width() - margin_px, y), theme.muted, 14, False, "midright")


def _draw_key(surface: pygame.Surface, kind: str, at_px: tuple[float, float], colour: Colour, width: int) -> None:
    """Draw a legend's small picture, enlarged and shrunk so that its edges are smooth."""
    big = pygame.Surface((112, 96), pygame.SRCALPHA, 32)
    big.fill((*colour, 0))
    if kind == "arrow":
        pygame.draw.rect(big, colour, (6, 48 - width * 2, 66, width * 4))
        half = 14 + 3 * width
        pygame.draw.polygon(big, colour, [(68, 48 - half), (108, 48), (68, 48 + half)])
    elif kind == "ring":
        pygame.draw.circle(big, (*colour, 60), (56, 48), 36)
        pygame.draw.circle(big, colour, (56, 48), 36, width * 4)
    else:
        pygame.draw.line(big, colour, (32, 24), (80, 72), width * 5)
        pygame.draw.line(big, colour, (32, 72), (80, 24), width * 5)
    small = pygame.transform.smoothscale(big, (28, 24))
    surface.blit(small, small.get_rect(center=(round(at_px[0]), round(at_px[1]))))
