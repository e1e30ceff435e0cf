"""What every process of a training run beside the trainer's own does first."""

from __future__ import annotations

import os
import signal
import threading
from multiprocessing import parent_process
from multiprocessing.connection import wait

import torch


def begin() -> None:
    """Keep to one thread, leave signals to the trainer, and end when it ends."""
    torch.set_num_threads(1)
    # Ctrl-C and SIGTERM reach the whole process group, but how a run ends is for the trainer.
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, signal.SIG_IGN)
    threading.Thread(target=_end_with_the_trainer, daemon=True).start()


def _end_with_the_trainer() -> None:
    """A killed trainer reads no more: a worker that still has something to hand on would wait."""
    trainer = parent_process()
    if trainer is not None:
        wait([trainer.sentinel])
        os._exit(1)
