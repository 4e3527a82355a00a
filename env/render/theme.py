"""Colours and sizes of the picture."""

from __future__ import annotations

from dataclasses import dataclass

from steerclear.shield.exceptions import ConfigError

Colour = tuple[int, int, int]


@dataclass(frozen=True)
class Theme:
    """One set of colours, red-green-blue 0..255.

    Attributes:
        page: Around the field.
        water: Field of team 0 and of team 1.
        grid: Lines every 10 m.
        edge: Border of the field and the scrimmage line.
        ink: Text and strong marks.
        muted: Secondary text.
        team: Team 0 and team 1.
        wanted: Arrow of a command the shield did not send.
        changed: Arrow and halo of a command the shield changed.
        breach: Two boats inside the separation radius.
        obstacle: Fixed obstacles.
        plate: Behind labels.
    """

    page: Colour
    water: tuple[Colour, Colour]
    grid: Colour
    edge: Colour
    ink: Colour
    muted: Colour
    team: tuple[Colour, Colour]
    wanted: Colour
    changed: Colour
    breach: Colour
    obstacle: Colour
    plate: Colour


THEMES = {
    "light": Theme(
        page=(248, 250, 252),
        water=((226, 238, 250), (251, 233, 229)),
        grid=(255, 255, 255),
        edge=(100, 116, 139),
        ink=(15, 23, 42),
        muted=(84, 98, 118),
        team=((29, 92, 208), (206, 58, 48)),
        wanted=(71, 85, 105),
        changed=(240, 130, 0),
        breach=(190, 24, 147),
        obstacle=(120, 113, 108),
        plate=(255, 255, 255),
    ),
    "dark": Theme(
        page=(11, 18, 32),
        water=((16, 38, 66), (56, 27, 36)),
        grid=(38, 56, 84),
        edge=(120, 140, 168),
        ink=(236, 242, 250),
        muted=(148, 163, 184),
        team=((86, 156, 255), (255, 108, 96)),
        wanted=(190, 202, 220),
        changed=(255, 171, 46),
        breach=(255, 92, 214),
        obstacle=(148, 140, 132),
        plate=(20, 30, 48),
    ),
}
"""The themes by name."""


def get_theme(name: str) -> Theme:
    """Look up a theme.

    Args:
        name: One of ``THEMES``.

    Returns:
        The theme.

    Raises:
        ConfigError: There is no theme of that name.
    """
    if name not in THEMES:
        raise ConfigError(f"there is no theme {name!r}; choose {' or '.join(THEMES)}.")
    return THEMES[name]


def mix(first: Colour, second: Colour, share: float) -> Colour:
    """Blend two colours; ``share`` 0 gives the first, 1 the second."""
    red, green, blue = (round(a + (b - a) * share) for a, b in zip(first, second, strict=True))
    return red, green, blue
