#!/usr/bin/env bash
# Makes .venv with lidaraccum in it, system libraries included. Usage: setup.sh [EXTRA]
# Run again after a change of pyproject.toml or constraints.txt; otherwise it has nothing to do.
set -euo pipefail
cd "$(dirname "$0")/.."
extra="${1:-}"

# Open3D's shared libraries, and what makes a virtual environment on a bare Debian or Ubuntu.
if command -v dpkg-query >/dev/null; then
    missing=()
    for package in libusb-1.0-0 libgl1 libgomp1 libx11-6; do
        dpkg-query -W -f='${Status}' "$package" 2>/dev/null | grep -q 'ok installed' \
            || missing+=("$package")
    done
    python3 -c 'import ensurepip' 2>/dev/null || missing+=(python3-venv)
    if [ ${#missing[@]} -gt 0 ]; then
        as_root=()
        if [ "$(id -u)" -ne 0 ]; then
            if ! command -v sudo >/dev/null; then
                echo "As root, first: apt-get update && apt-get install -y ${missing[*]}" >&2
                exit 1
            fi
            as_root=(sudo)
        fi
        echo "Installing ${missing[*]}" >&2
        "${as_root[@]}" apt-get update -qq
        DEBIAN_FRONTEND=noninteractive "${as_root[@]}" apt-get install -y -qq "${missing[@]}" >/dev/null
    fi
fi

wanted="$(cat pyproject.toml constraints.txt | sha256sum) $PWD"
if [ "$(cat .venv/installed-"${extra:-core}" 2>/dev/null)" != "$wanted" ]; then
    echo "Installing lidaraccum into .venv" >&2
    python3 -m venv .venv
    .venv/bin/python -m pip install -q --disable-pip-version-check \
        -c constraints.txt -e ".${extra:+[$extra]}"
    echo "$wanted" >.venv/installed-"${extra:-core}"
fi
