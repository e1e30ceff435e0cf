"""Times the shipped network's stages on simulated frames. Usage: time_network.py [THREADS]."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from typing import TypeVar

import numpy as np
import torch

from lidaraccum.model.batch import prepare, to_tensors
from lidaraccum.model.bytes import in_bytes
from lidaraccum.model.checkpoint import load_network
from lidaraccum.model.motion import Windows
from lidaraccum.model.network import MOST_POINTS, presence_map
from lidaraccum.model.precision import has_bfloat16, inference
from lidaraccum.model.reader import NetworkReader
from lidaraccum.model.weights import chosen_weights
from lidaraccum.simulation.drive import simulate
from lidaraccum.simulation.settings import DriveSettings

Answer = TypeVar("Answer")


def timed(name: str, call: Callable[[], Answer], repeats: int = 5) -> Answer:
    """Run a few times, print the best in milliseconds, hand on the answer."""
    answer, best = call(), float("inf")
    for _ in range(repeats):
        start = time.perf_counter()
        answer = call()
        best = min(best, time.perf_counter() - start)
    print(f"| {name} | {1e3 * best:.0f} |")
    return answer


def main() -> None:
    """A five-frame window of an HDL-64E on the 64 m grid."""
    torch.set_num_threads(int(sys.argv[1]) if len(sys.argv) > 1 else 2)
    network = in_bytes(load_network(chosen_weights(None)))
    sequence = simulate(DriveSettings(seed=2, sensor="HDL-64E", rate_hz=10.0))
    frames = [sequence[index] for index in range(5)]
    print(f"bfloat16: {has_bfloat16('cpu')}; points: {[len(frame) for frame in frames]}")
    prepared = timed("prepare (numpy)", lambda: [prepare(f, network.settings) for f in frames])
    tensors = timed("to tensors", lambda: to_tensors(prepared))
    windows, poses = Windows.single(5), torch.eye(4).expand(5, 4, 4)
    with torch.no_grad(), inference():
        maps = timed("of encode: pillars", lambda: network.pillars(tensors))
        timed("of encode: backbone", lambda: network.backbone(maps))
        features = timed("encode", lambda: network.encode(tensors))
        timed("match (four pairs)", lambda: network.match_windows(features, windows))
        timed(
            "of perceive: motion map",
            lambda: network.motion_map(
                features.maps, presence_map(features), poses, windows, tensors.stamps, 32.0
            ),
        )
        seen = timed(
            "perceive", lambda: network.perceive(features, poses, windows, most=MOST_POINTS)
        )
        ids = torch.arange(len(seen.point)) % 30
        timed("track (29 objects)", lambda: network.track(seen, ids))
    reader, still = NetworkReader(network), np.tile(np.eye(4), (5, 1, 1))
    encoded = [reader.read(frame) for frame in frames]
    timed("the pipeline's read (one frame)", lambda: reader.read(frames[0]))
    timed("the pipeline's look (five frames)", lambda: reader.look(encoded, still, 0))


if __name__ == "__main__":
    main()
