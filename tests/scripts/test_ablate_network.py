"""The network with its parts left out, through the user's door."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

from lidaraccum.model.checkpoint import save_network
from lidaraccum.model.network import build_network
from lidaraccum.model.settings import NetworkSettings

ROOT = Path(__file__).parents[2]


def test_a_row_for_each_part_beside_the_papers(tmp_path: Path) -> None:
    settings = NetworkSettings(base_widths=(16, 24), motion_widths=(32, 48), ego_pillars=64)
    save_network(build_network(settings, 3), tmp_path / "weights.safetensors")
    command = [
        sys.executable, ROOT / "scripts" / "ablate_network.py", tmp_path / "weights.safetensors",
        "--windows", "1", "--extent", "32", "--drive", ROOT / "examples" / "street",
    ]  # fmt: skip
    done = subprocess.run(list(map(str, command)), capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    rows = [line for line in done.stdout.splitlines() if line.startswith("| ")]
    names = [row.split("|")[1].strip() for row in rows if "---" not in row]
    parts = ["nothing", "foreground", "motion", "offsets", "direct poses"]
    assert names[1 : 1 + len(parts)] == parts
    assert len(names) == 1 + 2 * len(parts)
    assert len({row.count("|") for row in rows}) == 1
