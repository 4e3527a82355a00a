"""Text: at the boats, and around the field the header with score and time, and the legend."""

from __future__ import annotations

import numpy as np
import pygame
from steerclear.env.record_file import NOT_COVERED
from steerclear.env.render.boats import CLOSE_SEPARATIONS, MIN_HULL_PX, command_end
from steerclear.env.render.canvas import Canvas, font
from steerclear.env.render.scene import Arena, Colour, Scene, Theme, closest_pair
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


TEXT_PX = 13
NUMBER_PX = 12
_DIRECTIONS = [np.array([np.sin(turn), -np.cos(turn)]) for turn in np.radians(np.arange(0.0, 360.0, 30.0))]


def draw_labels(surface: pygame.Surface, canvas: Canvas, scene: Scene, arena: Arena, theme: Theme) -> None:
    """Write the boats' numbers, what the shield did, and the closest distance.

    Args:
        surface: The finished picture.
        canvas: Tells where the boats are on it.
        scene: The moment.
        arena: The field.
        theme: Colours.
    """
    reach_px = max(arena.separation_m / 2 * canvas.scale_px_per_m, MIN_HULL_PX / 2)
    spots = [canvas.to_px(centre) for centre in scene.position_m]
    taken = [_around(spot, reach_px) for spot in spots] + _marks_to_keep_clear(canvas, scene)
    _draw_distance(surface, canvas, scene, arena, theme, taken)
    changed = np.zeros(len(spots), bool) if scene.overlay is None else np.asarray(scene.overlay.intervened)
    for boat in np.argsort(~changed, kind="stable").tolist():
        if changed[boat]:
            text = f"{_name(boat, arena)}  {_shield_text(scene, boat, arena)}"
            _plate(surface, text, spots[boat], reach_px, taken, (theme.ink, theme.changed, theme.plate))
        else:
            text = f"{_name(boat, arena)} out" if scene.oob[boat] else _name(boat, arena)
            place = free_place(surface.get_rect(), font(NUMBER_PX, True).size(text), spots[boat], reach_px, taken)
            draw_text(surface, text, place.center, theme.team[arena.team[boat]], NUMBER_PX, True, "center")
            taken.append(place)


def _name(boat: int, arena: Arena) -> str:
    return f"{boat} you" if arena.names[boat] in arena.steered else str(boat)


def _marks_to_keep_clear(canvas: Canvas, scene: Scene) -> list[pygame.Rect]:
    """Return boxes over the flags and along the arrows of commands the shield changed."""
    boxes = []
    for foot in scene.flag_position_m:
        x, y = canvas.to_px(foot)
        boxes.append(pygame.Rect(round(x) - 6, round(y) - 28, 28, 32))
    if scene.overlay is None:
        return boxes
    for boat in np.flatnonzero(scene.overlay.intervened):
        start = scene.position_m[boat]
        for command in (scene.overlay.wanted[boat], scene.overlay.sent[boat]):
            way = command_end(start, command) - start
            boxes += [_around(canvas.to_px(start + share * way), 6.0) for share in np.linspace(0.1, 1.0, 10)]
    return boxes


def _shield_text(scene: Scene, boat: int, arena: Arena) -> str:
    if scene.overlay is None:
        return ""
    safety_margin_m = float(scene.overlay.safety_margin_m[boat])
    margin = f"  {safety_margin_m:+.1f} m".replace("-", "−") if np.isfinite(safety_margin_m) else ""
    reason = int(scene.overlay.reason[boat])
    return ("changed" if reason == NOT_COVERED else arena.reason_text(reason)) + margin


def _draw_distance(
    surface: pygame.Surface, canvas: Canvas, scene: Scene, arena: Arena, theme: Theme, taken: list[pygame.Rect]
) -> None:
    """Write the distance of the closest pair beside the line that joins it."""
    pair = closest_pair(scene, arena)
    if pair is None or pair[2] > CLOSE_SEPARATIONS * arena.separation_m:
        return
    first, second, gap_m = pair
    middle = canvas.to_px((scene.position_m[first] + scene.position_m[second]) / 2)
    colours = (theme.plate, theme.breach, theme.breach) if gap_m <= arena.separation_m else None
    _plate(surface, f"{gap_m:.1f} m", middle, 4.0, taken, colours or (theme.muted, theme.muted, theme.plate))


def _plate(
    surface: pygame.Surface,
    text: str,
    spot_px: tuple[float, float],
    reach_px: float,
    taken: list[pygame.Rect],
    colours: tuple[Colour, Colour, Colour],
) -> None:
    """Write text on a plate near a spot and join them; ``colours`` are those of text, edge and plate."""
    width, height = font(TEXT_PX).size(text)
    place = free_place(surface.get_rect(), (width + 12, height + 6), spot_px, reach_px, taken)
    ink, edge, fill = colours
    toward = np.array(place.center) - spot_px
    start = np.array(spot_px) + toward / max(1e-9, float(np.linalg.norm(toward))) * reach_px
    pygame.draw.aaline(surface, edge, start.tolist(), place.center)
    pygame.draw.rect(surface, fill, place, border_radius=6)
    pygame.draw.rect(surface, edge, place, 1, border_radius=6)
    draw_text(surface, text, place.center, ink, TEXT_PX, False, "center")
    taken.append(place)


def free_place(
    picture: pygame.Rect,
    size_px: tuple[int, int],
    spot_px: tuple[float, float],
    reach_px: float,
    taken: list[pygame.Rect],
) -> pygame.Rect:
    """Find a place near a spot that nothing else has; the nearest one that covers least when all are taken.

    Args:
        picture: The whole picture.
        size_px: Width and height of the label.
        spot_px: What the label belongs to.
        reach_px: How far from the spot the label begins.
        taken: Places to keep clear.

    Returns:
        The place.
    """
    field = pygame.Rect(4, HEADER_PX, picture.width - 8, picture.height - HEADER_PX - FOOTER_PX)
    best, least = pygame.Rect((0, 0), size_px), np.inf
    for far_px in (2.0, 10.0, 22.0, 38.0, 58.0):
        for direction in _DIRECTIONS:
            place = pygame.Rect((0, 0), size_px)
            away = direction * (reach_px + far_px + np.array(size_px) / 2)
            place.center = (round(spot_px[0] + away[0]), round(spot_px[1] + away[1]))
            place.clamp_ip(field)
            covered = sum(_area(place.clip(other)) for other in taken)
            if covered == 0:
                return place
            if covered < least:
                best, least = place, covered
    return best


def _area(box: pygame.Rect) -> int:
    return box.width * box.height


def _around(spot_px: tuple[float, float], reach_px: float) -> pygame.Rect:
    half = round(reach_px)
    return pygame.Rect(round(spot_px[0]) - half, round(spot_px[1]) - half, 2 * half, 2 * half)
