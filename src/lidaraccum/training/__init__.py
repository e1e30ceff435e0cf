"""Training: losses, windows from labelled sequences, the loop. Entry: `trainer.train`."""
