from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

CONFTEST = Path(__file__).parents[1] / "conftest.py"

CONTENT = {
    "skip": "import pytest\ndef test_it(): pytest.skip('not today')\n",
    "missing": "import pytest\nmodule = pytest.importorskip('no_such_module')\n",
    "marked": "import pytest\n@pytest.mark.skip(reason='lazy')\ndef test_it(): pass\n",
    "allowed": "import pytest\ndef test_it(): pytest.skip('mrcal is not installed: so')\n",
    "expected": "import pytest\n@pytest.mark.xfail\ndef test_it(): assert False\n",
}
REFUSED = {"skip", "missing", "marked"}


@pytest.mark.parametrize(("setting", "refused"), [("0", set[str]()), ("1", REFUSED)])
def test_a_skip_fails_where_skips_are_forbidden(
    tmp_path: Path, setting: str, refused: set[str]
) -> None:
    (tmp_path / "conftest.py").write_text(CONFTEST.read_text())
    for name, content in CONTENT.items():
        (tmp_path / f"test_{name}.py").write_text(content)
    outcome = subprocess.run(
        [sys.executable, "-m", "pytest", "-q", "-rfE", "--continue-on-collection-errors",
         "-p", "no:cacheprovider", str(tmp_path)],
        env=os.environ | {"CELL_NO_SKIP": setting, "PYTEST_DISABLE_PLUGIN_AUTOLOAD": "1"},
        cwd=tmp_path,
        capture_output=True,
        text=True,
    )  # fmt: skip
    bad = [line for line in outcome.stdout.splitlines() if line.startswith(("FAILED", "ERROR "))]
    assert {name for name in CONTENT if any(f"test_{name}.py" in line for line in bad)} == refused
    assert outcome.stdout.count("CELL_NO_SKIP=1 forbids") >= len(refused)
    assert (outcome.returncode == 0) == (not refused), outcome.stdout
