"""Reachable sets, against drives and shapely."""

import numpy as np
import pytest
import shapely
from conftest import driven

import sidestep


def bounds(rng, steps):
    """Random bounds at the paper's rates."""
    pairs = np.sort(rng.uniform(-0.5, 0.5, (steps, 2)), axis=1)
    return pairs[:, 0], pairs[:, 1]


def test_drives_are_inside_and_others_are_not(rng):
    for _ in range(25):
        steps = int(rng.integers(1, 11))
        lo, hi = bounds(rng, steps)
        start = rng.uniform([-5, -5, -3], [5, 5, 3])
        reachable = sidestep.ReachableSet(start, lo, hi)
        tube = shapely.Polygon(reachable.tube(conservative=True)).buffer(0)
        rates = rng.uniform(lo, hi, (30, steps))
        ends = np.array([driven(start, each)[1:] for each in rates])
        assert shapely.contains_xy(tube.buffer(1e-9), ends[..., 0], ends[..., 1]).all()
        for step in range(1, steps + 1):
            assert reachable.contains(ends[:, step - 1], step).all()
        assert reachable.contains_drive(ends[0]).all()
        far = ends[:, -1] + [0.5 * steps, 0, 0]
        assert not reachable.contains(far[:1] + [100, 0, 0], steps).any()


def test_everything_that_a_car_can_reach():
    full = np.full((1, 10), 0.5)
    (reachable,) = sidestep.reach([1, 2, 0.5], -full, full)
    assert reachable.steps == 10
    tube = shapely.Polygon(reachable.tube())
    assert tube.is_valid and tube.exterior.is_ccw
    # Decision 7: 16/3 m² after ten steps at the paper's rates.
    assert abs(tube.area - 16 / 3) < 0.01
    last = shapely.Polygon(reachable.polygon(10))
    assert last.is_valid and tube.buffer(2e-3).contains(last)
    np.testing.assert_allclose(reachable.polygon(0), [[1, 2]])


def test_polygons_say_by_how_much_they_were_grown():
    full = np.full(10, 0.5)
    reachable = sidestep.ReachableSet([1, 2, 0.5], -full, full)
    polygon, margin_m = reachable.tube(return_margin=True)
    np.testing.assert_array_equal(polygon, reachable.tube())
    assert margin_m == 0
    polygon, margin_m = reachable.polygon(10, conservative=True, return_margin=True)
    np.testing.assert_array_equal(polygon, reachable.polygon(10, conservative=True))
    assert 0 < margin_m < 0.01
    # At half a turn per step there is only a convex polygon around the set.
    full = np.full(100, np.pi)
    turning = sidestep.ReachableSet([0, 0, 0], -full, full, 2.0, 1.0)
    polygon, margin_m = turning.polygon(100, return_margin=True)
    assert margin_m == np.inf
    around = shapely.Polygon(polygon)
    assert around.convex_hull.area == pytest.approx(around.area, rel=1e-12)


def test_many_sets_at_once(rng):
    lo, hi = np.array([bounds(rng, 6) for _ in range(4)]).transpose(1, 0, 2)
    sets = sidestep.reach([0, 0, 0], lo, hi, 3.0, 0.1)
    for low, high, reachable in zip(lo, hi, sets, strict=True):
        alone = sidestep.ReachableSet([0, 0, 0], low, high, 3.0, 0.1)
        np.testing.assert_array_equal(reachable.tube(), alone.tube())
    assert sidestep.reach([0, 0, 0], np.zeros((0, 3)), np.zeros((0, 3))) == []


def test_tolerances_are_kept(rng):
    straight = sidestep.ReachableSet([0, 0, 0], np.zeros(5), np.zeros(5))
    beside = [[2.0, 0.02, 0.0]]
    assert not straight.contains(beside, 5).any()
    assert straight.contains(beside, 5, position_m=0.03).all()
    turned = [[2.0, 0.0, 0.05]]
    assert not straight.contains(turned, 5).any()
    assert straight.contains(turned, 5, heading_rad=0.06).all()
    with pytest.raises(ValueError, match="position_m: expected a finite number ≥ 0, found -1"):
        straight.contains(beside, 5, position_m=-1)
