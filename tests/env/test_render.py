"""Pictures, windows and films of games."""

import os
import subprocess

import imageio.v3 as iio
import imageio_ffmpeg
import numpy as np
import pygame
import pytest
from PIL import Image
from steerclear.env.config import GameConfig
from steerclear.env.mctf import MctfEnv
from steerclear.env.record import meta_of, read_meta
from steerclear.env.render import THEMES, Arena, Overlay, Picture, Renderer, Scene, save_animation, save_frame
from steerclear.env.render.renderer import pixels
from steerclear.shield.exceptions import ConfigError, TraceError

WIDTH_PX = 640


@pytest.fixture
def no_display(monkeypatch):
    """A machine without a screen."""
    for name in ("DISPLAY", "WAYLAND_DISPLAY", "SDL_VIDEODRIVER"):
        monkeypatch.delenv(name, raising=False)


@pytest.fixture
def game():
    env = MctfEnv(GameConfig.preset("aamas2024", max_time_s=30.0))
    env.reset(seed=1)
    yield env
    env.close()


def drawn(record, step, theme="light", width_px=WIDTH_PX, **changes):
    arena = Arena.from_meta({**read_meta(record), **changes})
    return pixels(Picture(arena, width_px, theme).draw(Scene.from_record(record, step, arena.dt_s)))


def share_of(image, colour, tolerance=6):
    return float((np.abs(image.astype(int) - colour).max(axis=-1) <= tolerance).mean())


def advance(env, steps=3):
    for _ in range(steps):
        env.step(dict.fromkeys(env.agents, (2.0, 30.0)))


@pytest.mark.usefixtures("no_display")
def test_live_frames_need_no_display_and_show_the_game(game):
    environment = dict(os.environ)
    renderer = Renderer(game.config, "rgb_array", WIDTH_PX)
    first = renderer.draw(game.view())
    advance(game)
    second = renderer.draw(game.view())
    renderer.close()
    renderer.close()
    assert first.dtype == np.uint8
    assert first.shape[1:] == (WIDTH_PX, 3)
    assert first.shape[0] % 16 == 0
    assert len(np.unique(first.reshape(-1, 3), axis=0)) > 50
    assert 0.0005 < np.any(first != second, axis=-1).mean() < 0.2
    assert dict(os.environ) == environment


def test_boats_are_drawn_where_they_are_in_their_colours(game_record):
    arena = Arena.from_meta(read_meta(game_record))
    scene = Scene.from_record(game_record, 5, arena.dt_s)
    picture = Picture(arena, 1280)
    image = pixels(picture.draw(scene))
    for boat, centre in enumerate(scene.position_m):
        x, y = picture._canvas.to_px(centre)
        around = image[round(y) - 8 : round(y) + 9, round(x) - 8 : round(x) + 9]
        assert share_of(around, THEMES["light"].team[arena.team[boat]]) > 0.1


def test_a_changed_command_shows_in_its_own_colour(game_record):
    colour = THEMES["light"].changed
    legend = share_of(drawn(game_record, 5, width_px=1280), colour)
    assert share_of(drawn(game_record, 12, width_px=1280), colour) > legend + 0.0003
    assert np.isnan(game_record["nominal"][31, 1]).all()
    drawn(game_record, 31)


def test_a_violation_shows_in_its_own_colour(game_record):
    step = int(game_record["violations"][0, 0])
    assert step > 1
    colour = THEMES["light"].violation
    calm, violation = drawn(game_record, 0, width_px=1280), drawn(game_record, step, width_px=1280)
    assert share_of(violation, colour) > share_of(calm, colour) + 0.0002


def test_an_overlay_left_with_the_renderer_is_drawn_until_another_is_given(game):
    renderer = Renderer(game.config, width_px=WIDTH_PX)
    plain = renderer.draw(game.view())
    nominal = np.tile([2.0, 90.0], (6, 1))
    filtered = np.where(np.arange(6)[:, None] == 1, [1.0, 0.0], nominal)
    overlay = Overlay.of_commands(nominal, filtered)
    assert overlay.intervened.tolist() == [False, True, False, False, False, False]
    assert Overlay.of_commands(np.array([[np.nan, 0.0]]), np.zeros((1, 2))).intervened.tolist() == [True]
    renderer.overlay = overlay
    left = renderer.draw(game.view())
    assert np.any(left != plain)
    np.testing.assert_array_equal(left, renderer.draw(game.view(), overlay))


def test_the_renderer_takes_over_what_the_config_does_not_tell(game):
    renderer = Renderer(game.config, width_px=WIDTH_PX)
    plain = renderer.draw(game.view())
    renderer.describe(meta_of(game.config, policies={"blue": "medium"}, shielded=["agent_0"], separation_m=6.0))
    told = renderer.draw(game.view())
    assert renderer.arena.separation_m == 6.0
    assert [renderer.arena.reason_text(code) for code in (6, 9)] == ["no shield", "reason 9"]
    assert np.any(told[:60] != plain[:60])
    assert np.any(told[60:] != plain[60:])


def test_obstacles_and_a_slanted_line_between_the_halves_are_drawn(game_record):
    plain = drawn(game_record, 0, obstacles=None)
    assert share_of(drawn(game_record, 0), THEMES["light"].obstacle) > share_of(plain, THEMES["light"].obstacle)
    slanted = drawn(game_record, 0, scrimmage=((30.0, 0.0), (50.0, 40.0)))
    top, bottom = slanted[80], slanted[-60]
    blue = THEMES["light"].water[0]
    assert share_of(top, blue) > share_of(bottom, blue) + 0.1
    assert drawn(game_record, 0, env_bounds_m=(30.0, 60.0)).shape[1] == WIDTH_PX, "a high field"


def test_a_new_game_clears_the_tracks(game):
    renderer = Renderer(game.config, width_px=WIDTH_PX)
    fresh = renderer.draw(game.view())
    for _ in range(5):
        advance(game)
        renderer.draw(game.view())
    game.reset(seed=1)
    np.testing.assert_array_equal(renderer.draw(game.view()), fresh)


def test_a_window_opens_takes_keys_and_closes(monkeypatch, game):
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    renderer = Renderer(game.config, "human", WIDTH_PX, speedup=100.0)
    assert renderer.keys() == set()
    assert renderer.draw(game.view()) is None
    pygame.event.post(pygame.event.Event(pygame.KEYDOWN, key=pygame.K_LEFT))
    pygame.event.post(pygame.event.Event(pygame.KEYDOWN, key=pygame.K_w))
    assert renderer.keys() == {"left", "w"}
    pygame.event.post(pygame.event.Event(pygame.KEYUP, key=pygame.K_w))
    assert renderer.keys() == {"left"}
    for kind in (pygame.KEYDOWN, pygame.KEYUP):  # a tap between two pictures counts once
        pygame.event.post(pygame.event.Event(kind, key=pygame.K_2))
    assert renderer.keys() == {"left", "2"}
    assert renderer.keys() == {"left"}
    assert not renderer.window_closed
    pygame.event.post(pygame.event.Event(pygame.QUIT))
    renderer.draw(game.view())
    assert renderer.window_closed
    renderer.close()
    assert not pygame.display.get_init()


def test_no_display_is_one_clear_error(monkeypatch, game):
    monkeypatch.setenv("SDL_VIDEODRIVER", "nonsense")
    with pytest.raises(ConfigError, match="Use render_mode='rgb_array'"):
        Renderer(game.config, "human", WIDTH_PX).draw(game.view())


def test_a_window_nobody_would_see_is_no_window(monkeypatch, game):
    """Without a display SDL opens windows that are nowhere, and a game by keyboard would wait for keys for ever."""
    for name in ("DISPLAY", "WAYLAND_DISPLAY", "SDL_VIDEODRIVER"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setattr(pygame.display, "get_driver", lambda: "offscreen")
    with pytest.raises(ConfigError, match="no display"):
        Renderer(game.config, "human", WIDTH_PX).draw(game.view())
    assert not pygame.display.get_init()


def test_records_that_cannot_be_drawn(game_meta, game_record, tmp_path):
    for meta in (
        {**game_meta, "env_bounds_m": 3},
        {name: value for name, value in game_meta.items() if name != "team"},
    ):
        with pytest.raises(TraceError, match="cannot be drawn"):
            Renderer(meta)
    with pytest.raises(TraceError, match="lacks filtered"):
        save_animation({name: values for name, values in game_record.items() if name != "filtered"}, tmp_path / "a.gif")


def test_a_frame_is_saved(game_record, tmp_path):
    path = save_frame(game_record, -1, tmp_path / "deep" / "last.png", WIDTH_PX)
    np.testing.assert_array_equal(iio.imread(path), drawn(game_record, 60))
    for step in (61, -62):
        with pytest.raises(ConfigError, match="the record has 0 to 60"):
            save_frame(game_record, step, tmp_path / "none.png")


def read_mp4(path):
    """Frames of a film; imageio's own reader leaves its pipes open."""
    command = [imageio_ffmpeg.get_ffmpeg_exe(), "-i", path, "-f", "rawvideo", "-pix_fmt", "rgb24", "-"]
    content = subprocess.run(command, capture_output=True, check=True).stdout
    return np.frombuffer(content, np.uint8).reshape(-1, 400, WIDTH_PX, 3)


@pytest.mark.parametrize("ending", ["gif", "mp4"])
def test_a_film_shows_the_game(game_record, tmp_path, ending):
    calls = []
    path = save_animation(
        game_record,
        tmp_path / f"game.{ending}",
        fps=10.0,
        speedup=10.0,
        progress=lambda done, of: calls.append((done, of)),
        width_px=WIDTH_PX,
    )
    frames = iio.imread(path, index=None) if ending == "gif" else read_mp4(path)
    assert calls == [(k, 7) for k in range(1, 8)]  # 6 s of game at ten times its speed, ten pictures a second
    assert frames.shape[0] == 7
    for frame, step in zip(frames, range(0, 61, 10), strict=True):
        error = np.abs(frame[..., :3].astype(int) - drawn(game_record, step)).mean()
        assert error < 4.0
    assert [file.name for file in tmp_path.iterdir()] == [path.name]
    if ending == "gif":
        save_animation(game_record, path, 10.0, 10.0, start_s=2.0, end_s=4.0, width_px=WIDTH_PX)
        with Image.open(path) as film:
            assert film.n_frames == 3


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"path": "a.avi"}, "end the name in .mp4 or .gif"),
        ({"fps": 0.0}, "choose 0 < fps <= 100"),
        ({"speedup": -1.0}, "speedup > 0"),
        ({"start_s": 7.0}, "the record lasts from 0 to 6.0 s"),
        ({"start_s": 3.0, "end_s": 2.0}, "cannot show 3.0 s to 2.0 s"),
    ],
)
def test_films_that_cannot_be_made(game_record, tmp_path, arguments, words):
    arguments = {"path": "a.gif", **arguments}
    path = tmp_path / arguments.pop("path")
    with pytest.raises(ConfigError, match=words):
        save_animation(game_record, path, **arguments)
    assert list(tmp_path.iterdir()) == []
