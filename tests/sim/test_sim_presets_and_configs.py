"""The cell files that come with the project and the simulator's presets are the same cells."""

from pathlib import Path

import numpy as np
import pytest

from cell.devices.simulated_cell import simulated_cell
from cell.storage.files.cell_file import read_cell
from sim.presets import irb140_eosens, ur3_robotiq

CONFIGS = Path(__file__).parents[2] / "configs"


@pytest.mark.parametrize(
    ("name", "preset"),
    [("irb140-eosens.cell.yaml", irb140_eosens()), ("ur3-robotiq.cell.yaml", ur3_robotiq())],
)
def test_the_file_says_what_the_preset_says(name, preset):
    cell = read_cell(CONFIGS / name)
    home = np.radians(cell.layout.home_deg)
    made = simulated_cell(cell, home)
    assert (made.robot_model, made.board, made.mount) == (
        preset.robot_model,
        preset.board,
        preset.mount,
    )
    np.testing.assert_allclose(made.model.optics, preset.model.optics)
    for transform in ("flange_from_mounted", "base_from_fixed"):
        here, there = getattr(made.model, transform), getattr(preset.model, transform)
        np.testing.assert_allclose(here, there, atol=1e-6)
    (effect,), (expected,) = made.model.effects, preset.model.effects
    assert effect.effect.label == expected.effect.label
    np.testing.assert_allclose(effect.values, expected.values, rtol=1e-3)
    assert made.camera.aperture_m == pytest.approx(preset.camera.aperture_m)
    assert made.camera.nearest_focus_m == preset.camera.nearest_focus_m
    assert made.repeatability.position_m == pytest.approx(preset.repeatability.position_m, rel=0.02)
    assert (made.corner_sigma_px, made.payload_kg) == (preset.corner_sigma_px, preset.payload_kg)
    np.testing.assert_allclose(home, preset.home_rad, atol=0.02)
