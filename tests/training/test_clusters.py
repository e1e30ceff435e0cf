"""Laws of imperfect clusters."""

from __future__ import annotations

from dataclasses import replace

import torch

from lidaraccum.training.clusters import (
    TRUE_CLUSTERS,
    ClusterSettings,
    imperfect_clusters,
    truth_of_clusters,
)


def scene() -> tuple[torch.Tensor, torch.Tensor, torch.Tensor]:
    """Two objects 3 m apart in window 0, one in window 1, background about the first."""
    generator = torch.Generator().manual_seed(0)
    position = torch.rand(400, 3, generator=generator)
    row = torch.arange(400) // 100 - 1
    position[row == 1, 0] += 3.0
    window = (row == 2).long()
    return position, row, window


def clusters(settings: ClusterSettings, seed: int = 0) -> torch.Tensor:
    position, row, window = scene()
    generator = torch.Generator().manual_seed(seed)
    return imperfect_clusters(position, row, window, settings, generator)


def test_perfect_clusters_are_the_objects() -> None:
    _, row, _ = scene()
    assert torch.equal(clusters(TRUE_CLUSTERS), row + 1)


def test_a_merged_cluster_holds_both_objects_of_one_window_only() -> None:
    _, row, window = scene()
    merged = clusters(replace(TRUE_CLUSTERS, merged=1.0))
    assert len(torch.unique(merged[(row == 0) | (row == 1)])) <= 2
    assert not set(merged[window == 1].tolist()) & set(merged[window == 0].tolist())
    assert (merged[row == 0] == merged[row == 1]).all()


def test_a_split_object_is_two_clusters_on_two_sides() -> None:
    _, row, _ = scene()
    split = clusters(replace(TRUE_CLUSTERS, split=1.0))
    for number in range(3):
        sizes = torch.bincount(split[row == number])
        assert (sizes[sizes > 0] > 20).sum() == 2


def test_background_joins_only_where_it_is_near() -> None:
    _, row, _ = scene()
    swollen = clusters(replace(TRUE_CLUSTERS, background=1.0))
    assert (swollen[row < 0] == 1).float().mean() > 0.9


def test_thinned_clusters_lose_a_third() -> None:
    _, row, _ = scene()
    kept = (clusters(replace(TRUE_CLUSTERS, thinned=1.0)) > 0)[row >= 0]
    assert 0.55 < float(kept.float().mean()) < 0.78


def test_strays_are_few_and_lie_near() -> None:
    """Up to 3 % of an object's points; each from its own window, and no further than 3 m off."""
    position, row, window = scene()
    far = (row < 0) & (torch.arange(400) % 2 == 0)
    position[far, 0] -= 9.0
    taken = []
    for seed in range(40):
        generator = torch.Generator().manual_seed(seed)
        wrong = imperfect_clusters(
            position, row, window, replace(TRUE_CLUSTERS, strays=1.0), generator
        )
        strays = (wrong != row + 1) & (wrong > 0)
        assert not strays[far].any()
        assert not strays[window == 1].any()
        taken.append(int(strays.sum()))
    assert 0.5 < sum(taken) / 40 < 4.5  # of two objects with a hundred points each
    assert max(taken) < 15


def test_a_cluster_is_what_most_of_its_points_are() -> None:
    cluster = torch.tensor([5, 5, 5, 9, 9, 0])
    row = torch.tensor([2, 2, -1, -1, 0, 1])
    row = torch.cat([row, torch.tensor([-1])])
    cluster = torch.cat([cluster, torch.tensor([9])])
    ids, owner = truth_of_clusters(cluster, row)
    assert ids.tolist() == [5, 9]
    assert owner.tolist() == [2, -1]


def test_no_object_no_cluster() -> None:
    row = torch.full((7,), -1)
    generator = torch.Generator().manual_seed(0)
    got = imperfect_clusters(
        torch.rand(7, 3), row, torch.zeros(7).long(), ClusterSettings(), generator
    )
    assert not got.any()
