"""The paper's own figures, to stand beside ours.

Huang et al., "Dynamic 3D Scene Analysis by Point Cloud Accumulation" (ECCV 2022), table 1 (scene
flow), table 4 (ablations) and the supplement. Other data, and without ground except where it says
so: they tell how far a method gets, not which of two is better.
"""

from __future__ import annotations

from lidaraccum.evaluation.table import Row

WAYMO = Row(
    name="paper, Waymo T=5",
    static_epe_cm=2.8,
    static_acc_strict=97.5,
    static_acc_relaxed=99.5,
    static_robust_outlier=0.1,
    still_epe_cm=2.1,
    dynamic_epe_cm=19.7,
    dynamic_median_cm=6.2,
    dynamic_acc_strict=53.3,
    dynamic_acc_relaxed=77.5,
    dynamic_robust_outlier=5.9,
    motion_precision=96.8,
    motion_recall=92.2,
    coverage=80.4,
    seconds=0.174,
)
WAYMO_ICP = Row(
    name="paper, Waymo T=5, with ICP",
    static_epe_cm=1.8,
    static_acc_strict=99.0,
    static_acc_relaxed=99.7,
    static_robust_outlier=0.1,
    dynamic_epe_cm=17.3,
    dynamic_median_cm=4.3,
    dynamic_acc_strict=69.1,
    dynamic_acc_relaxed=86.9,
    dynamic_robust_outlier=5.1,
)
WAYMO_GROUND = Row(
    name="paper, Waymo T=5, with ground",
    static_epe_cm=4.2,
    static_acc_strict=91.9,
    static_acc_relaxed=98.8,
    static_robust_outlier=0.1,
    dynamic_epe_cm=21.9,
    dynamic_median_cm=7.1,
    dynamic_acc_strict=47.1,
    dynamic_acc_relaxed=72.8,
    dynamic_robust_outlier=8.5,
)
NUSCENES = Row(
    name="paper, nuScenes T=11",
    static_epe_cm=11.1,
    static_acc_strict=65.4,
    static_acc_relaxed=88.6,
    static_robust_outlier=1.1,
    still_epe_cm=7.4,
    dynamic_epe_cm=30.1,
    dynamic_median_cm=14.6,
    dynamic_acc_strict=26.6,
    dynamic_acc_relaxed=53.4,
    dynamic_robust_outlier=12.1,
    motion_precision=90.8,
    motion_recall=89.3,
    coverage=63.2,
    seconds=0.250,
)
ROWS = (WAYMO, WAYMO_ICP, WAYMO_GROUND, NUSCENES)

LENGTHS = (3, 4, 5, 6, 7, 8, 9, 10)
STATIC_EPE_CM_BY_LENGTH = (2.2, 2.5, 2.8, 3.2, 3.7, 4.4, 5.4, 6.6)
DYNAMIC_EPE_CM_BY_LENGTH = (19.9, 16.8, 19.0, 21.8, 25.0, 29.4, 34.8, 41.2)
"""Table 2, Waymo, by frames a window."""

SCENES = "paper, Waymo: static EPE 8.8 ± 23.7 cm, dynamic EPE 16.9 ± 25.9 cm over scenes"
"""Supplement, first table."""
