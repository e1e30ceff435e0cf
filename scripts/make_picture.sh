#!/usr/bin/env bash
# Makes the README's picture from the shipped example: docs/images/before_after.png.
set -euo pipefail
cd "$(dirname "$0")/.."
bash scripts/setup.sh dev
clouds="$(mktemp -d)"
trap 'rm -rf "$clouds"' EXIT
yes "1 0 0 0 0 1 0 0 0 0 1 0" | head -10 >"$clouds/identity.txt" || true
accumulate=(.venv/bin/lidaraccum accumulate examples/street -q --no-sidecars)
"${accumulate[@]}" --method ego-only --poses "$clouds/identity.txt" -o "$clouds/as_recorded.ply"
"${accumulate[@]}" --method ego-only -o "$clouds/ego-motion_undone.ply"
"${accumulate[@]}" --static-only -o "$clouds/movers_removed.ply"
"${accumulate[@]}" -o "$clouds/accumulated.ply"
.venv/bin/python examples/picture.py "$clouds"/{as_recorded,ego-motion_undone,movers_removed,accumulated}.ply \
    --radius 20 --centre -2 -2 --pixels 420 -o docs/images/before_after.png
