"""Movers and movables proposed by the network, verified by geometry."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor

from lidaraccum.data.perceived import PerceivedFrame
from lidaraccum.data.registered import RegisteredFrame
from lidaraccum.pipeline.freespace import SightedFrame
from lidaraccum.pipeline.motion_settings import BALANCED, MotionSettings
from lidaraccum.pipeline.mover_stream import MoverStream
from lidaraccum.pipeline.network_advice import NetworkAdvice
from lidaraccum.pipeline.object_ids import ObjectIds
from lidaraccum.pipeline.sighting import Sighter
from lidaraccum.pipeline.tubes import Reader


class NetworkLed:
    """As `LabelFree`, a stride farther ahead; the network points out what may move and what could.

    Every mover it proposes must explain the points better than standing still, as must what free
    space raises suspicion of: a wrong network costs time. What it takes for movable and does not
    move is labelled still, on its word alone; that moves no point.
    """

    def __init__(self, reader: Reader, settings: MotionSettings = BALANCED) -> None:
        self._reader = reader
        self.settings = settings

    @property
    def weights(self) -> str:
        """Hash of the network's weights."""
        return self._reader.weights

    def perceive(self, frames: Iterable[RegisteredFrame]) -> Iterator[PerceivedFrame]:
        """Each frame once, in order, its movers labelled and placed, what stands named."""
        return self.perceive_sighted(Sighter(self.settings).all(frames))

    def perceive_sighted(self, frames: Iterable[SightedFrame]) -> Iterator[PerceivedFrame]:
        """As `perceive`, of frames that a `Sighter` of the same settings has sighted."""
        ids = ObjectIds()
        worker = ThreadPoolExecutor(max_workers=1)
        try:
            advice = NetworkAdvice(self._reader, self.settings, ids, worker)
            yield from MoverStream(self.settings, advice, ids).run(frames)
        finally:
            worker.shutdown(cancel_futures=True)
