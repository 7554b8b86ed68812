"""What a verb loads before it has any data: only what it needs."""

import subprocess
import sys

import pytest

HEAVY = ("numba", "scipy", "matplotlib", "cv2", "pydantic", "numpy", "rich.markdown")
STATISTICS = ("scipy.stats", "scipy.interpolate")


def loaded(code: str, names: tuple[str, ...]) -> list[str]:
    ask = f"{code}\nimport sys; print([n for n in {names!r} if n in sys.modules])"
    done = subprocess.run([sys.executable, "-c", ask], capture_output=True, text=True, check=True)
    return list(eval(done.stdout.splitlines()[-1]))


def test_help_is_shown_without_a_single_heavy_library() -> None:
    shown = (
        "import sys; sys.argv = ['cell', '--help']\n"
        "from cell.cli import main\n"
        "try: main()\nexcept SystemExit: pass"
    )
    assert loaded(shown, HEAVY) == []


@pytest.mark.parametrize(
    ("module", "names"),
    [
        ("cell.verbs.export", ("numba", "scipy", "matplotlib", "cv2")),
        ("cell.views.report", ("matplotlib", *STATISTICS)),
        ("calib.calibration", STATISTICS),
        ("calib.discovery.diagnose", STATISTICS),
    ],
)
def test_a_verb_loads_what_it_needs(module: str, names: tuple[str, ...]) -> None:
    assert loaded(f"import {module}", names) == []
