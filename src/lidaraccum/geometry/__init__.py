"""Pure functions of arrays: rigid motions, grids, voxels, clusters."""
