"""Labelled sequences out of a ray-cast world."""
