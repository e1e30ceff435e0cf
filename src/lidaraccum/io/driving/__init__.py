"""Driving data sets in: logs with tracked boxes as labelled sequences."""
