"""Averages the weights of runs that began from the same weights: better than each, at no cost.

Usage: average_weights.py WEIGHTS WEIGHTS... -o OUT

Source: Wortsman et al., "Model soups" (ICML 2022). The runs may differ in seed and recipe; the
networks must have the same settings.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import torch

from lidaraccum.model.checkpoint import load_network, save_network
from lidaraccum.model.weights import weights_hash


def main() -> None:
    """Average and write."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("weights", nargs="+", type=Path)
    parser.add_argument("-o", "--output", required=True, type=Path)
    options = parser.parse_args()
    networks = [load_network(path) for path in options.weights]
    settings = {network.settings for network in networks}
    if len(settings) > 1:
        parser.error("the networks differ in their settings")
    mean = networks[0]
    others = [dict(network.named_parameters()) for network in networks]
    with torch.no_grad():
        for name, values in mean.named_parameters():
            values.copy_(torch.stack([other[name] for other in others]).mean(dim=0))
    parts = ", ".join(weights_hash(path)[:12] for path in options.weights)
    save_network(mean, options.output, {"mean_of": parts})


if __name__ == "__main__":
    main()
