"""Text: labels at the boats, the header with score and time, and the legend."""

from __future__ import annotations

import numpy as np
import pygame
from steerclear.env.record_file import NOT_COVERED
from steerclear.env.render.boats import CLOSE_SEPARATIONS, MIN_HULL_PX, command_end
from steerclear.env.render.canvas import Canvas, Colour, Theme, font
from steerclear.env.render.scene import Arena, Scene, closest_pair
from steerclear.shield.foreign import visible

HEADER_PX, FOOTER_PX, MARGIN_PX = 62, 40, 24
TEXT_PX, NUMBER_PX = 13, 12
STEERING = "you: ringed   ahead ↑ W   turn ← → A D   back ↓ S   half speed Shift   stop: no key"
"""The keys, as `steerclear.policies` reads them."""

MOST_LETTERS = 200
"""Longest line, in characters; longer ones fit in no picture."""

TEAM_NAMES = ("BLUE", "RED")
_DIRECTIONS = [np.array([np.sin(turn), -np.cos(turn)]) for turn in np.radians(np.arange(0.0, 360.0, 30.0))]


def draw_text(
    surface: pygame.Surface,
    text: str,
    at_px: tuple[float, float],
    colour: Colour,
    size_px: int = 14,
    bold: bool = False,
    anchor: str = "midleft",
) -> pygame.Rect:
    """Write one line of text.

    ``at_px`` is the place of its ``anchor``, one of pygame's names for points of a rectangle.
    """
    image = font(size_px, bold).render(visible(text)[:MOST_LETTERS], True, colour)
    box = image.get_rect()
    setattr(box, anchor, (round(at_px[0]), round(at_px[1])))
    surface.blit(image, box)
    return box


def draw_header(surface: pygame.Surface, scene: Scene, arena: Arena, theme: Theme) -> None:
    """Write teams, score and time above the field."""
    width, middle = surface.get_width(), HEADER_PX / 2
    for team, anchor, edge in ((0, "midleft", MARGIN_PX), (1, "midright", width - MARGIN_PX)):
        score = str(int(scene.captures[team]))
        box = draw_text(surface, score, (edge, middle), theme.team[team], 40, True, anchor)
        beside = box.right + 14 if team == 0 else box.left - 14
        covered = any(arena.team[k] == team and name in arena.shielded for k, name in enumerate(arena.names))
        player = _joined(arena.policies[team], "shield on" if covered else "")
        draw_text(surface, TEAM_NAMES[team], (beside, middle - 10), theme.team[team], 17, True, anchor)
        draw_text(surface, player, (beside, middle + 12), theme.muted, anchor=anchor)
    minutes, seconds = divmod(scene.time_s + 1e-9, 60.0)
    clock = f"{int(minutes):02d}:{seconds:04.1f}" if seconds < 59.95 else f"{int(minutes) + 1:02d}:00.0"
    draw_text(surface, clock, (width / 2, middle - 9), theme.ink, 27, True, "center")
    pair = closest_pair(scene, arena)
    line = _joined(arena.title, "" if pair is None else f"closest pair {pair[2]:.1f} m")
    colour = theme.violation if pair is not None and pair[2] <= arena.separation_m else theme.muted
    draw_text(surface, line, (width / 2, middle + 17), colour, anchor="center")


def _joined(*parts: str) -> str:
    return "  ·  ".join(part for part in parts if part)


def draw_legend(surface: pygame.Surface, arena: Arena, theme: Theme) -> None:
    """Explain the marks below the field."""
    x, y, end = float(MARGIN_PX), surface.get_height() - FOOTER_PX / 2, surface.get_width() - MARGIN_PX
    if arena.steered:
        x = draw_text(surface, STEERING, (x, y), theme.ink, bold=True).right + 26
    entries = (
        ("arrow", theme.nominal, 2, "nominal command"),
        ("arrow", theme.changed, 5, "filtered command"),
        ("ring", theme.muted, 2, f"discs touch = closer than {arena.separation_m:g} m"),
        ("ring", theme.violation, 3, "separation violation"),
        ("cross", theme.ink, 2, "tagged"),
    )
    for kind, colour, width, text in entries:
        if x + 32 + font(14).size(text)[0] > end:
            break
        _draw_key(surface, kind, (x + 12, y), colour, width)
        x = draw_text(surface, text, (x + 32, y), theme.muted).right + 26
    scale = f"grid 10 m   ·   {arena.bounds_m[0]:g} × {arena.bounds_m[1]:g} m"
    if x < end - font(14).size(scale)[0]:
        draw_text(surface, scale, (end, y), theme.muted, anchor="midright")


def _draw_key(surface: pygame.Surface, kind: str, at_px: tuple[float, float], colour: Colour, width: int) -> None:
    """Draw a symbol of the legend, enlarged and then shrunk so that its edges are smooth."""
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


class Labels:
    """Places labels on a finished picture so that they cover neither each other nor boats, flags and arrows.

    Args:
        surface: The finished picture.
        spots_px: The boats' positions on it.
        reach_px: Distance from its boat at which a label begins.
        taken: Further places to leave free.
    """

    def __init__(
        self, surface: pygame.Surface, spots_px: list[tuple[float, float]], reach_px: float, taken: list[pygame.Rect]
    ) -> None:
        self.surface, self.spots_px, self.reach_px = surface, spots_px, reach_px
        self.taken = [_around(spot, reach_px) for spot in spots_px] + taken

    def number(self, text: str, boat: int, colour: Colour) -> None:
        """Write a boat's number beside it."""
        place = self._place(font(NUMBER_PX, True).size(text), self.spots_px[boat], self.reach_px)
        draw_text(self.surface, text, place.center, colour, NUMBER_PX, True, "center")

    def plate(
        self, text: str, spot: tuple[float, float], reach: float, ink: Colour, edge: Colour, fill: Colour
    ) -> None:
        """Write text on a plate near a spot and join them."""
        width, height = font(TEXT_PX).size(text)
        place = self._place((width + 12, height + 6), spot, reach)
        toward = np.array(place.center) - spot
        start = np.array(spot) + toward / max(1e-9, float(np.linalg.norm(toward))) * reach
        pygame.draw.aaline(self.surface, edge, start.tolist(), place.center)
        pygame.draw.rect(self.surface, fill, place, border_radius=6)
        pygame.draw.rect(self.surface, edge, place, 1, border_radius=6)
        draw_text(self.surface, text, place.center, ink, TEXT_PX, False, "center")

    def _place(self, size_px: tuple[int, int], spot_px: tuple[float, float], reach_px: float) -> pygame.Rect:
        """Reserve a free place near a spot; if none is free, the one that covers least."""
        picture = self.surface.get_rect()
        field = pygame.Rect(4, HEADER_PX, picture.width - 8, picture.height - HEADER_PX - FOOTER_PX)
        best, least = pygame.Rect((0, 0), size_px), np.inf
        for far_px in (2.0, 10.0, 22.0, 38.0, 58.0):
            for direction in _DIRECTIONS:
                place = pygame.Rect((0, 0), size_px)
                away = direction * (reach_px + far_px + np.array(size_px) / 2)
                place.center = (round(spot_px[0] + away[0]), round(spot_px[1] + away[1]))
                place.clamp_ip(field)
                common = [place.clip(other) for other in self.taken]
                covered = sum(box.width * box.height for box in common)
                if covered < least:
                    best, least = place, covered
                if least == 0:
                    break
            if least == 0:
                break
        self.taken.append(best)
        return best


def draw_labels(surface: pygame.Surface, canvas: Canvas, scene: Scene, arena: Arena, theme: Theme) -> None:
    """Write the boats' numbers, the shield's interventions, and the closest distance."""
    reach_px = max(arena.separation_m / 2 * canvas.scale_px_per_m, MIN_HULL_PX / 2)
    spots = [canvas.to_px(centre) for centre in scene.position_m]
    labels = Labels(surface, spots, reach_px, _marks_to_clear(canvas, scene))
    pair = closest_pair(scene, arena)
    if pair is not None and pair[2] <= CLOSE_SEPARATIONS * arena.separation_m:
        middle = canvas.to_px((scene.position_m[pair[0]] + scene.position_m[pair[1]]) / 2)
        inside = pair[2] <= arena.separation_m
        colours = (theme.plate, theme.violation, theme.violation) if inside else (theme.muted, theme.muted, theme.plate)
        labels.plate(f"{pair[2]:.1f} m", middle, 4.0, *colours)
    changed = np.zeros(len(spots), bool) if scene.overlay is None else np.asarray(scene.overlay.intervened)
    for boat in np.argsort(~changed, kind="stable").tolist():
        name = f"{boat} you" if arena.names[boat] in arena.steered else str(boat)
        if changed[boat]:
            text = f"{name}  {_shield_text(scene, boat, arena)}"
            labels.plate(text, spots[boat], reach_px, theme.ink, theme.changed, theme.plate)
        else:
            labels.number(f"{name} out" if scene.oob[boat] else name, boat, theme.team[arena.team[boat]])


def _marks_to_clear(canvas: Canvas, scene: Scene) -> list[pygame.Rect]:
    """Return boxes over the flags and along the arrows of changed commands."""
    feet = [canvas.to_px(foot) for foot in scene.flag_position_m]
    boxes = [pygame.Rect(round(x) - 6, round(y) - 28, 28, 32) for x, y in feet]
    if scene.overlay is None:
        return boxes
    for boat in np.flatnonzero(scene.overlay.intervened):
        start = scene.position_m[boat]
        for command in (scene.overlay.nominal[boat], scene.overlay.filtered[boat]):
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


def _around(spot_px: tuple[float, float], reach_px: float) -> pygame.Rect:
    half = round(reach_px)
    return pygame.Rect(round(spot_px[0]) - half, round(spot_px[1]) - half, 2 * half, 2 * half)
