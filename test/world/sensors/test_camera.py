# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""A camera detects by the pixels on its object, in the cells of its footprint."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from dsse_ros.base.fields import FieldError
from dsse_ros.search.step.looks import looks_of
from dsse_ros.world.scenario.scenario import scenario_and_rules
from dsse_ros.world.sensors.camera import footprint_m, image_pod


def pods(action: str, **fields: Any) -> dict[tuple[int, int], float]:
    """Return the POD of each cell that an action looks at."""
    scenario, rules = scenario_and_rules(rules="v2", sensor="camera", **fields)
    looks = looks_of(scenario.resolve(rules), rules)
    rows = looks.numbers(0, rules.actions.index(action))
    return {tuple(looks.offsets[row].tolist()): looks.pods[row, 0] for row in rows}  # type: ignore[misc]


def test_pod_is_that_of_johnson_up_to_the_sensitivity_measured_at_sea() -> None:
    assert [image_pod(pixels) for pixels in (2, 4, 100)] == pytest.approx([0.5, 0.79, 0.91])
    found = [image_pod(pixels) for pixels in np.linspace(0, 30, 100)]
    assert found[0] == 0 and found == sorted(found)


def test_the_cell_of_the_paper_is_the_footprint() -> None:
    assert footprint_m(120.0, 56.885857) == pytest.approx(130.0, abs=1e-3)
    assert pods("search") == pods("right") == {(0, 0): 0.91}


def test_four_pixels_on_the_object_from_the_altitude_that_gives_them() -> None:
    # 0.5 m over 130 m of sea is 4 of 1040 pixels, from twice as high 2.
    assert pods("right", image_width=1040) == pytest.approx({(0, 0): 0.79}, abs=1e-4)
    higher = pods("right", image_width=1040, altitude=240.0, cell_size=130.0)
    assert higher == pytest.approx({(0, -1): 0.25, (0, 0): 0.5, (0, 1): 0.25}, abs=1e-4)


def test_a_search_hovers_over_the_whole_footprint() -> None:
    seen = pods("search", cell_size=65.0)
    assert seen == pytest.approx(
        {
            (x, y): 0.91 * (0.5 if x else 1) * (0.5 if y else 1)
            for x in (-1, 0, 1)
            for y in (-1, 0, 1)
        },
        abs=1e-4,
    )


@pytest.mark.parametrize(("weather", "factor"), [("good", 1.0), ("fair", 0.5), ("poor", 0.25)])
def test_weather_and_a_short_time_in_view_lower_the_pod(weather: str, factor: float) -> None:
    # At 10 m/s a point is in view for 13 s.
    seen = pods("right", weather=weather, dwell_time=26.0)
    assert seen == pytest.approx({(0, 0): 0.91 * factor / 2}, abs=1e-4)
    assert pods("right", weather=weather, dwell_time=13.0 - 1e-3)[0, 0] == 0.91 * factor


def test_a_footprint_of_too_many_cells_is_refused_in_a_line() -> None:
    with pytest.raises(FieldError, match="cell_size must be at least 18.5714 m") as error:
        pods("search", cell_size=10.0)
    assert "\n" not in str(error.value)
