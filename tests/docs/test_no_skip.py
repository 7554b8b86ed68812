from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

CONFTEST = Path(__file__).parents[1] / "conftest.py"


@pytest.mark.parametrize(
    ("content", "fails"),
    [
        ("import pytest\ndef test_it(): pytest.skip('not today')\n", True),
        ("import pytest\nmodule = pytest.importorskip('no_such_module')\n", True),
        ("import pytest\n@pytest.mark.skip(reason='lazy')\ndef test_it(): pass\n", True),
        ("import pytest\ndef test_it(): pytest.skip('mrcal is not installed: so')\n", False),
        ("import pytest\n@pytest.mark.xfail\ndef test_it(): assert False\n", False),
    ],
)
def test_a_skip_fails_where_skips_are_forbidden(tmp_path: Path, content: str, fails: bool) -> None:
    (tmp_path / "conftest.py").write_text(CONFTEST.read_text())
    (tmp_path / "test_some.py").write_text(content)
    outcome = {
        setting: subprocess.run(
            [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", str(tmp_path)],
            env=os.environ | {"CELL_NO_SKIP": setting},
            cwd=tmp_path,
            capture_output=True,
            text=True,
        )
        for setting in ("0", "1")
    }
    # 5: nothing was collected, which is how a module skipped as a whole ends
    assert outcome["0"].returncode in (0, 5), outcome["0"].stdout
    assert (outcome["1"].returncode not in (0, 5)) == fails, outcome["1"].stdout
    if fails:
        assert "CELL_NO_SKIP=1 forbids" in outcome["1"].stdout
