"""The paper's Tables 1 and 2 beside the same tables of the two simulated cells, as Markdown.

python -m benchmarks.paper_tables
"""

from __future__ import annotations

from benchmarks.paper_runs import PLANS, Plan, Run, run_named

PARAMETERS = ("alpha_px", "beta_px", "u0_px", "v0_px", "skew_px", "k1", "k2")
ROWS = (
    "fixed_alpha_algebraic",
    "held_algebraic",
    "held_mle",
    "fixed_alpha_mle",
    "zhang_algebraic",
    "zhang_mle",
    "joint_ml",
)
NAMES = {
    "fixed_alpha_algebraic": "proposed, algebraic, each distance's value (Eq. 20)",
    "held_algebraic": "proposed, algebraic, one held value for all views",
    "held_mle": "proposed, MLE, one held value for all views",
    "fixed_alpha_mle": "proposed, MLE, held at each distance's value (Eq. 24)",
    "zhang_algebraic": "Zhang, algebraic",
    "zhang_mle": "Zhang, MLE",
    "joint_ml": "joint fit with the robot (not in the paper)",
}
TABLE_1 = {
    "ur3-robotiq": {
        "held_algebraic": (0.3362, 2.1709),
        "held_mle": (9.0165e-11, 1.5626),
        "zhang_algebraic": (0.0472, 1.8667),
        "zhang_mle": (1.8347e-10, 1.0487),
    },
    "irb140-eosens": {
        "held_algebraic": (-2.4143, 14.4151),
        "held_mle": (-1.5807e-10, 3.1542),
        "zhang_algebraic": (0.4644, 9.0036),
        "zhang_mle": (1.2092e-09, 2.3201),
    },
}
TABLE_2 = {
    "ur3-robotiq": {
        "proposed": (1370.8, 1373.8, 645.8, 359.3, 0.0001, 0.0087, -0.072),
        "zhang_algebraic": (1362.8, 1369.9, 651.7, 370.5, -0.002, 0.0048, -0.056),
        "zhang_mle": (1319.7, 1329.7, 711.2, 375.9, 0.0008, -0.016, -0.003),
    },
    "irb140-eosens": {
        "proposed": (4755.8, 4789.1, 2052.3, 1548.5, 0.0012, 0.0022, 0.0570),
        "zhang_algebraic": (4487.0, 4442.8, 2046.8, 1448.1, 0.0239, 0.0421, -0.134),
        "zhang_mle": (4289.8, 4295.1, 2127.5, 1566.7, 0.0280, -0.1703, 0.1389),
    },
}


def print_run(cell_name: str, plan: Plan) -> None:
    """One plan's three tables."""
    found = run_named(cell_name, plan.name)
    law = found.whole.focus_law
    assert law is not None
    print(f"\n### {cell_name}, {plan.name}\n")
    tilts = " to ".join(f"{t:.0f}" for t in plan.tilt_deg)
    general = len(found.camera_from_board)
    values = ", ".join(
        f"{n} = {p.value:.4g} ± {p.sigma:.2g} {p.unit}" for n, p in law.preferred.parameters.items()
    )
    print(
        f"{found.parallel} parallel views {plan.nearest_m} to {plan.farthest_parallel_m} m,"
        f" {general} general ones to {plan.farthest_general_m} m, tilted {tilts} degrees from near"
        f" to far. Law found: {law.preferred.law}, {values} ({law.why}).\n"
    )
    print_table_1(cell_name, found)
    print_table_2(cell_name, found)


def print_table_1(cell_name: str, found: Run) -> None:
    """Reprojection as in Table 1, and camera positions against the truth."""
    print(
        "| solution | paper: mean | paper: std px | simulated: mean | simulated: std px"
        " | simulated: camera error z mean, mm | rms, mm |\n|---|---|---|---|---|---|---|"
    )
    errors = found.error
    for name in ROWS:
        reported = TABLE_1[cell_name].get(name)
        paper = f"{reported[0]:.4g} | {reported[1]:.4f}" if reported else "– | –"
        pixels, error = found.solutions[name].reprojection_px, errors[name]
        print(
            f"| {NAMES[name]} | {paper} | {pixels['mean']:.1e} | {pixels['std']:.4f}"
            f" | {1e3 * error.mean[2]:+.2f} | {1e3 * error.rms:.2f} |"
        )
    print()


def print_table_2(cell_name: str, found: Run) -> None:
    """Parameters as in Table 2; the proposed method's alpha and beta are those at infinity."""
    proposed = {**found.solutions["fixed_alpha_mle"].values, **found.alpha0}
    columns = {
        "proposed": proposed,
        "zhang_algebraic": found.solutions["zhang_algebraic"].values,
        "zhang_mle": found.solutions["zhang_mle"].values,
    }
    print(
        "| | proposed: paper | simulated | Zhang algebraic: paper | simulated"
        " | Zhang MLE: paper | simulated |\n|---|---|---|---|---|---|---|"
    )
    for k, parameter in enumerate(PARAMETERS):
        cells = [
            f"{TABLE_2[cell_name][column][k]:g} | {columns[column][parameter]:.4f}"
            if k >= 4
            else f"{TABLE_2[cell_name][column][k]:g} | {columns[column][parameter]:.1f}"
            for column in columns
        ]
        print(f"| {parameter} | " + " | ".join(cells) + " |")


def main() -> None:
    """Print everything."""
    for name, (_, plans) in PLANS.items():
        for plan in plans:
            print_run(name, plan)


if __name__ == "__main__":
    main()
