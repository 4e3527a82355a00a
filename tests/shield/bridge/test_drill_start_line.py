"""Boats that lie at the game's start line can be drilled there: none is led where another one disturbs its drill."""

import re

import pytest
from bridge_fakes import World, fleet_text
from steerclear.env.config import GameConfig
from steerclear.experiments.sim_boats.game import start_places
from steerclear.experiments.sim_boats.settings import SimBoat
from steerclear.shield.bridge.drill import EACH_S, Drill, check_response
from steerclear.shield.bridge.fleet_file import parse_fleet


def drilled(platform, preset):
    """A drill of our three boats, each side on its own start line."""
    length, width = GameConfig.preset(preset, team_size=3).env_bounds_m
    fence = f"geofence: {{xmin_m: -5, ymin_m: -5, xmax_m: {length + 5}, ymax_m: {width + 5}}}"
    text = fleet_text(blue=3, red=3, platform=platform)
    fleet = parse_fleet(re.sub("geofence: .*", fence, text))
    boats = [SimBoat(name, platform, fleet.team_of[name]) for name in fleet.names]
    starts = [(*place, 0.0) for place in start_places(boats, GameConfig.preset(preset, team_size=3), None)]
    drill = Drill(fleet, fleet.names[:3])

    def rule(snapshot):
        drill.offer(snapshot)
        return drill.latest().commands.values

    others = [(name, *start) for name, start in zip(fleet.names[3:], starts[3:], strict=True)]
    world = World(fleet, starts[:3], rule, others=others)
    for name, *start in others:
        world.contacts.commands[name] = (start[2], 0.0)
    world.run(0.1).run(3 * EACH_S, each=lambda world: drill.take(world.last))
    return world, drill, fleet


@pytest.mark.parametrize("preset", ["aamas2024", "mctf2025"])
@pytest.mark.parametrize("platform", ["heron", "ardurover_boat"])
def test_a_drill_at_the_start_line_can_be_judged(platform, preset):
    world, drill, fleet = drilled(platform, preset)
    for boat, samples in drill.samples.items():
        assert sum(sample.changed for sample in samples) / len(samples) <= 0.05
        assert check_response(boat, samples, fleet.platform_of[boat], fleet.dt_s).passed
    assert world.closest_m > 2.5
