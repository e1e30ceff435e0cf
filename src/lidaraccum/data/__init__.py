"""What flows: frames, sequences, registered frames, accumulations."""
