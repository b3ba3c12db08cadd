# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""What the kernels read comes from the scenario and the rules, every name of it."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from dsse_ros.search.environments.world import World
from dsse_ros.search.step.constants import NO_ACTION, constants_of
from dsse_ros.world.scenario.rules import PROFILES, profile
from dsse_ros.world.scenario.scenario import Scenario
from dsse_ros.world.sensors.registry import SENSORS


@pytest.mark.parametrize("rules", PROFILES)
def test_the_map_of_one_world_is_among_those_of_all(rules: str) -> None:
    scenario = Scenario(grid_size=12, num_drones=2, vector=(0.4, -0.3), pre_search_minutes=2)
    dense = World(scenario, profile(rules), 3)
    bare = World(scenario, profile(rules), 3, write_maps=False)
    for world in (dense, bare):
        world.seed(5)
        world.reset()
    for _ in range(10):
        for b in range(3):
            assert bare.map_of(b).tobytes() == dense.map_of(b).tobytes() == dense.maps[b].tobytes()
        for world in (dense, bare):
            world.step(np.full((3, 2), NO_ACTION, np.int8))


@pytest.mark.parametrize("rules", PROFILES)
def test_the_constants_have_the_values_of_scenario_and_rules(rules: str) -> None:
    chosen = profile(rules)
    scenario = Scenario(sigma_x=1.5, sigma_y=2.5, drone_speed=7.0).resolve(chosen)
    constants = constants_of(scenario, chosen)[0]
    checked = 0
    for source in (scenario, chosen):
        for name, value in vars(source).items():
            if name in (constants.dtype.names or ()):
                assert np.array_equal(constants[name], value), name
                checked += 1
    assert checked > 30
    moves = list(zip(constants["dx"].tolist(), constants["dy"].tolist(), strict=True))
    assert tuple(moves[: constants["num_actions"]]) == chosen.action_set.moves
    of_search = constants["search_action"]
    assert chosen.actions[of_search] == "search" if chosen.actions else of_search == -1


@pytest.mark.parametrize(
    "maps",
    [
        np.zeros((3, 9, 8), np.float32),
        np.zeros((3, 9, 9)),
        np.zeros((9, 9, 3), np.float32).T,
        np.broadcast_to(np.float32(0), (3, 9, 9)),
    ],
)
def test_memory_that_maps_do_not_fit_in_is_refused(maps: np.ndarray) -> None:
    world = World(Scenario(grid_size=9, num_drones=2), profile("v2"), 3)
    world.reset()
    before = world.state_bytes()
    with pytest.raises(ValueError, match=r"maps must be C-contiguous float32 \(3, 9, 9\)"):
        world.step(np.full((3, 2), NO_ACTION, np.int8), maps)
    assert world.state_bytes() == before


def test_actions_of_any_layout_and_integer_type_are_the_same_actions() -> None:
    states = set()
    actions = np.array([[0, 4], [1, 3], [2, 0]], np.int8)
    read_only = actions.copy()
    read_only.flags.writeable = False
    for given in (read_only, actions, np.asfortranarray(actions), actions.astype(">i4")):
        world = World(Scenario(grid_size=9, num_drones=2), profile("v2"), 3)
        world.seed(5)
        world.reset()
        world.step(given)
        world.step(actions)
        states.add(world.state_bytes())
    assert len(states) == 1


def test_however_long_the_sea_has_drifted_a_map_is_written_in_as_many_steps() -> None:
    fields: dict[str, Any] = {"grid_size": 9, "sigma": 3.0, "vector": (0.0, 0.0)}
    minutes = 20_000 * 13.0 / 60.0
    world, plain = (
        World(Scenario(**fields, pre_search_minutes=minutes), profile("paper", circle=circle))
        for circle in (True, False)
    )
    for each in (world, plain):
        each.reset()
    # The circle is far outside the grid: its rows end at the grid's edge, and the map has none.
    assert world.worlds["map_steps"][0] == 20_000
    assert world._scratch[0].circle[:-1].max() <= world.grid_size.longer
    assert np.allclose(world.maps, plain.maps, rtol=1e-6)


@pytest.mark.parametrize("fields", [{}, {"loss_rate": 0.1}, {"battery_move": 1.0}])
def test_a_world_lists_the_looks_of_its_drones_once(
    fields: dict[str, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    listed: list[str] = []
    own_cell = SENSORS["own_cell"]

    def counted(scenario: Any, kind: Any, action: str, move: Any) -> Any:
        listed.append(action)
        return own_cell.looks(scenario, kind, action, move)

    monkeypatch.setitem(SENSORS, "own_cell", own_cell._replace(looks=counted))
    rules = profile("paper")
    World(Scenario(grid_size=9, num_drones=2, **fields), rules, 3)
    assert listed == list(rules.actions)
