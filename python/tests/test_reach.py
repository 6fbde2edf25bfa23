"""Reachable sets, against drives and shapely."""

import pickle

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


def test_speeds_from_a_range(rng):
    full = np.full(10, 0.5)
    slow, fast = 1.0, 3.0
    reachable = sidestep.ReachableSet([1, 2, 0.5], -full, full, (slow, fast))
    polygon, margin_m = reachable.polygon(10, conservative=True, return_margin=True)
    assert 0 < margin_m < 1e-3
    last, tube = shapely.Polygon(polygon), shapely.Polygon(reachable.tube(conservative=True))
    assert last.is_valid and tube.is_valid and tube.buffer(2e-3).contains(last)
    # Drives that change their speed and turn rate four times per step.
    for _ in range(300):
        rates, speeds = rng.uniform(-0.5, 0.5, 40), rng.choice([slow, fast, rng.uniform(slow, fast)], 40)
        heading = 0.5 + np.concatenate([[0], np.cumsum(rates * 0.05)])
        chord = speeds * 0.05 * np.sinc(rates * 0.05 / 2 / np.pi)
        middle = 0.5 * (heading[1:] + heading[:-1])
        path = np.cumsum(chord[:, None] * np.stack([np.cos(middle), np.sin(middle)], axis=1), axis=0) + [1, 2]
        assert shapely.contains_xy(tube.buffer(1e-9), *path.T).all()
        assert shapely.contains_xy(last.buffer(1e-9), *path[-1])
        assert reachable.contains([[*path[-1], heading[-1]]], 10).all()
    assert not reachable.contains([[1, 2, 0.5], [50, 2, 0.5]], 10).any()
    # Each constant speed of the range is inside.
    for speed in (slow, 1.7, fast):
        constant = sidestep.ReachableSet([1, 2, 0.5], -full, full, speed)
        assert last.buffer(2e-3).contains(shapely.Polygon(constant.polygon(10)))
    np.testing.assert_array_equal(reachable.speed_mps, [slow, fast])
    assert sidestep.ReachableSet([1, 2, 0.5], -full, full).speed_mps == 2


def test_a_range_of_speeds_for_each_step():
    full = np.full(3, 0.5)
    speeds = [[1, 2], [0, 0], [0, 1]]
    reachable = sidestep.ReachableSet([0, 0, 0], -full, full, speeds)
    np.testing.assert_array_equal(reachable.speed_mps, speeds)
    kept = pickle.loads(pickle.dumps(reachable))
    assert kept == reachable and kept != sidestep.ReachableSet([0, 0, 0], -full, full, [1, 2])
    np.testing.assert_array_equal(kept.polygon(3), reachable.polygon(3))
    first, second = (shapely.Polygon(reachable.polygon(step)) for step in (1, 2))
    assert first.hausdorff_distance(second) < 2e-3
    one, two = sidestep.reach([0, 0, 0], np.array([-full, 0 * full]), np.array([full, full]), speeds)
    assert one == reachable and two != reachable
    for wrong, said in [
        ([[1, 2]] * 2, "speed_mps: expected 1 or 3, as many as steps, found 2"),
        ((2, 1), "speed_mps: expected two finite speeds"),
        ((-1, 1), "speed_mps: expected two finite speeds"),
        ((0, 0), "speed_mps: expected a finite number > 0"),
        ((1, 2, 3), "speed_mps"),
        (True, "speed_mps"),
    ]:
        with pytest.raises((ValueError, TypeError), match=said):
            sidestep.ReachableSet([0, 0, 0], -full, full, wrong)
