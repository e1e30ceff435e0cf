"""An evaluation as JSON: every figure by name, null where there is none."""

from __future__ import annotations

import math
from dataclasses import asdict
from typing import Any

import numpy as np

from lidaraccum.evaluation import paper
from lidaraccum.evaluation.categories import CATEGORIES
from lidaraccum.evaluation.evaluate import EvaluationReport, MethodReport
from lidaraccum.evaluation.report_page import ECDF_AT_M
from lidaraccum.evaluation.report_tables import PARTS, epe_by_gap
from lidaraccum.evaluation.table import row_of, scene_row_of
from lidaraccum.io.atomic import json_text
from lidaraccum.metrics.association import IOU_THRESHOLDS


def as_json(report: EvaluationReport) -> str:
    """The report as a JSON object."""
    content = {
        "settings": {
            **asdict(report.settings),
            "weights": None if report.settings.weights is None else str(report.settings.weights),
        },
        "methods": [_method(one) for one in report.methods],
        "paper": [asdict(row) for row in paper.ROWS],
    }
    return json_text(content)


def _method(one: MethodReport) -> dict[str, Any]:
    scores, flow = one.scores, one.scores.flow
    gaps = sorted(scores.by_gap)
    return {
        "method": one.method.name,
        "told": one.method.told,
        "weights": one.method.weights,
        "windows": scores.windows,
        "static_points": flow.static.points,
        "dynamic_points": flow.dynamic.points,
        "unknown_points": scores.unknown_points,
        "scores": asdict(row_of(one.method.name, scores)),
        "three_way_epe_m": {**asdict(flow.three_way), "mean": flow.three_way.mean},
        "bucket_normalised": {
            "categories": list(CATEGORIES),
            "static_epe_m": scores.by_speed.static_epe.tolist(),
            "dynamic_error": scores.by_speed.dynamic_error.tolist(),
            "mean_dynamic_error": scores.by_speed.mean_dynamic_error,
        },
        "rotation_error_deg": math.degrees(scores.absolute.rotation.mean),
        "instances": {
            "iou_above": list(IOU_THRESHOLDS),
            "precision": scores.association.precision.tolist(),
            "recall": scores.association.recall.tolist(),
        },
        "ecdf": {
            "epe_m": list(ECDF_AT_M),
            "static": flow.static.distribution.shares_below(np.array(ECDF_AT_M)).tolist(),
            "dynamic": flow.dynamic.distribution.shares_below(np.array(ECDF_AT_M)).tolist(),
        },
        "by_gap": {
            "frames": gaps,
            **{f"{part}_epe_cm": epe_by_gap(one, part, gaps) for part in PARTS},
        },
        "by_part": {
            kind: {name: asdict(part) for name, part in parts.items()}
            for kind, parts in scores.by_part.items()
        },
        "by_length": [
            {"frames": length, "windows": part.windows, **asdict(row_of("", part))}
            for length, part in one.by_length.items()
        ],
        "over_scenes": asdict(
            scene_row_of(one.method.name, [scene.scores for scene in one.scenes])
        ),
        "scenes": [asdict(row_of(scene.name, scene.scores)) for scene in one.scenes],
    }
