"""How good a result is: pure functions of arrays, thresholds named with their source."""
