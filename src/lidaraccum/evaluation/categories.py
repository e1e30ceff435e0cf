"""Five kinds of things, whatever words a data set has for them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from lidaraccum.data.frame import Labels

CATEGORIES = ("background", "car", "other vehicle", "pedestrian", "wheeled")
"""As the Argoverse 2 scene flow challenge has them (`metrics.flow_speeds`)."""

BACKGROUND, CAR, OTHER_VEHICLE, PEDESTRIAN, WHEELED = range(len(CATEGORIES))

_WORDS = {
    CAR: ("car", "vehicle", "regular_vehicle"),
    PEDESTRIAN: (
        "pedestrian",
        "person",
        "child",
        "adult",
        "worker",
        "stroller",
        "official_signaler",
        "animal",
        "dog",
    ),
    WHEELED: (
        "cyclist",
        "bicycl",
        "motorcycl",
        "bike",
        "scooter",
        "rider",
        "wheelchair",
        "wheeled",
    ),
}


def category_of(word: str) -> int:
    """Index in `CATEGORIES` of a data set's word for a movable thing.

    What is neither a car, nor on foot, nor on two wheels is another vehicle: vans, trucks, buses,
    trams, trailers and whatever has no name here.
    """
    plain = word.lower()
    for category, words in _WORDS.items():
        if any(plain.startswith(start) for start in words):
            return category
    return OTHER_VEHICLE


def point_categories(labels: Labels) -> NDArray[np.int64]:
    """Index in `CATEGORIES` (N,) of what each point is on, by the box of its instance."""
    category = np.where(labels.foreground, OTHER_VEHICLE, BACKGROUND).astype(np.int64)
    for box in labels.boxes:
        category[labels.instance == box.id] = category_of(box.category)
    return category
