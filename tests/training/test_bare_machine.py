"""Training asks for no more than torch, numpy, scipy, safetensors and a ray caster."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

from lidaraccum.training.state import METRICS_FILE, STATE_FILE, WEIGHTS_FILE


@pytest.mark.slow
def test_a_step_from_a_simulated_drive_needs_no_open3d(tmp_path: Path) -> None:
    script = Path(__file__).with_name("bare_machine.py")
    subprocess.run([sys.executable, str(script), str(tmp_path)], check=True, timeout=300)
    assert {STATE_FILE, WEIGHTS_FILE, METRICS_FILE} <= {path.name for path in tmp_path.iterdir()}
    (step,) = map(json.loads, (tmp_path / METRICS_FILE).read_text().splitlines())
    assert step["step"] == 1
    assert step["total"] > 0
