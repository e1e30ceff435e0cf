"""The method: frames in, one accumulation out."""
