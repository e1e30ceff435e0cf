"""Averages the weights of runs that began from the same weights: better than each, at no cost.

Usage: average_weights.py WEIGHTS WEIGHTS... -o OUT [--ego-pillars N] [--glance-odds P]
                          [--beside-odds P] [--tubes WEIGHTS] [--tube KIND]

Source: Wortsman et al., "Model soups" (ICML 2022). The runs may differ in seed and recipe, the
networks only in how many pillars they match and which they glance at: the mean as the first, or as
it is told. And in TubeNet, where one is named whose TubeNet the mean is to have: it then glances as
that one.
"""

from __future__ import annotations

import argparse
from dataclasses import replace
from pathlib import Path

import torch

from lidaraccum.model.checkpoint import load_network, save_network
from lidaraccum.model.deepen import deepened
from lidaraccum.model.settings import TUBES
from lidaraccum.model.weights import weights_hash


def main() -> None:
    """Average and write."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("weights", nargs="+", type=Path)
    parser.add_argument("-o", "--output", required=True, type=Path)
    parser.add_argument("--ego-pillars", type=int, help="background pillars matched in a frame")
    parser.add_argument("--tubes", type=Path, help="weights whose TubeNet the mean is to have")
    parser.add_argument("--glance-odds", type=float, help="how unlikely pillars are glanced at")
    parser.add_argument("--beside-odds", type=float, help="the same, beside what moves")
    parser.add_argument("--tube", choices=TUBES, help="the kind of TubeNet to go on as")
    options = parser.parse_args()
    networks = [load_network(path) for path in options.weights]
    mean = load_network(options.tubes) if options.tubes else networks[0]
    count = options.ego_pillars or networks[0].settings.ego_pillars
    own = mean.settings
    alike = {
        "ego_pillars": count,
        "glance_odds": options.glance_odds or own.glance_odds,
        "beside_odds": options.beside_odds or own.beside_odds,
    }
    if options.tubes:
        alike["tube"] = own.tube
    settings = {replace(network.settings, **alike) for network in [mean, *networks]}
    if len(settings) > 1:
        parser.error("the networks differ in their settings")
    mean.settings = settings.pop()
    others = [dict(network.named_parameters()) for network in networks]
    with torch.no_grad():
        for name, values in mean.named_parameters():
            if options.tubes is None or not name.startswith("tube_net."):
                values.copy_(torch.stack([other[name] for other in others]).mean(dim=0))
    notes = {"mean_of": ", ".join(weights_hash(path)[:12] for path in options.weights)}
    if options.tubes:
        notes["tubes_of"] = weights_hash(options.tubes)[:12]
    if options.tube:
        mean = deepened(mean, replace(mean.settings, tube=options.tube))
    save_network(mean, options.output, notes)


if __name__ == "__main__":
    main()
