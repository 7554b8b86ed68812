"""A small cell and plan to test on."""

from __future__ import annotations

CELL = """\
schema: cell.cell/1
name: bench
robot: {driver: sim, model: ur5e}
camera: {driver: sim, model: bench-camera, width: 640, height: 480, pixel_size_um: 5.0}
board: {type: chessboard, rows: 4, cols: 5, square_m: 0.03}
layout:
  mounted: {p_m: [0.0, 0.0, 0.05], rpy_deg: [0, 0, 0]}
  fixed: {p_m: [0.5, 0.0, 0.0], rpy_deg: [180, 0, 0]}
  home_deg: [0, -90, 90, -90, -90, 0]
  distances_m: [0.3, 0.6]
workspace: {low_m: [-1, -1, -0.2], high_m: [1, 1, 1.2]}
keep_out:
- {name: cabinet, low_m: [-0.9, 0.4, 0.0], high_m: [-0.5, 0.8, 1.0]}
"""

SIMULATION = """\
simulation:
  mounted: {p_m: [0.0, 0.0, 0.05], rpy_deg: [0, 0, 0]}
  fixed: {p_m: [-0.55, -0.2, 0.0], rpy_deg: [180, 0, 0]}
  optics: {alpha_px: 500, beta_px: 500, u0_px: 320, v0_px: 240}
  noise: {corner_px: 0.1, read_levels: 0.0, full_well_electrons: null}
"""

PLAN = """\
schema: cell.plan/1
name: four views
cell: bench.yaml
speed_m_s: 0.2
views:
- {name: first, joints_deg: [0, -90, 90, -90, -90, 0]}
- {joints_deg: [5, -90, 90, -90, -90, 0]}
- {joints_deg: [5, -85, 90, -90, -90, 0]}
- {name: last, joints_deg: [0, -85, 90, -90, -90, 10]}
"""
