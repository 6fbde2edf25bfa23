//! Polygons of extremals, compared with conservative polygons, which do not use extremals. No
//! reachable position is outside a polygon of extremals by more than its accuracy.

use super::hard::Bounds;
use super::set;
use sidestep::math::SeededRng;
use sidestep::reach::polygon::signed_distance;
use sidestep::reach::{Outline, PolygonSettings, ReachableSet, Workspace};
use sidestep::vehicle::Pose;

/// Checks the tube and the last step. A conservative polygon with a tenth of the accuracy contains
/// the set, and exceeds it by about this tenth. Returns how far its farthest vertex is outside the
/// polygon of extremals, divided by the accuracy.
fn check(set: &ReachableSet, accuracy_m: f64) -> f64 {
    let exact = PolygonSettings::new(accuracy_m, 4).unwrap();
    let around = PolygonSettings::new(0.1 * accuracy_m, 4).unwrap().conservative();
    let around = around.with_most_pieces(100_000).unwrap().with_most_work(usize::MAX);
    let (mut workspace, mut polygon) = (Workspace::default(), Vec::new());
    let mut most = 0.0_f64;
    for tube in [true, false] {
        let mut draw = |settings| {
            let outline = if tube {
                set.tube_polygon_into(settings, &mut workspace, &mut polygon)
            } else {
                set.step_polygon_into(set.steps(), settings, &mut workspace, &mut polygon)
            };
            assert!(matches!(outline, Outline::Refined { .. }), "{outline:?} {set:?}");
            core::mem::take(&mut polygon)
        };
        let (exact, around) = (draw(exact), draw(around));
        let outside = around.iter().map(|vertex| signed_distance(&exact, *vertex));
        let outside = outside.fold(f64::NEG_INFINITY, f64::max);
        assert!(outside <= 1.2 * accuracy_m, "{outside} m, tube {tube}, {set:?}");
        most = most.max(outside / accuracy_m);
    }
    most
}

/// Decodes bounds from letters, each of which stands for an entry of `pool`.
fn spelt(letters: &str, pool: &[(f64, f64)]) -> ReachableSet {
    let place = |letter: u8| usize::from(letter - b'a');
    let (lo, hi): (Vec<_>, Vec<_>) = letters.bytes().map(|letter| pool[place(letter)]).unzip();
    set(Pose::new(0.0, 0.0, 0.0), &lo, &hi)
}

/// These bounds exclude straight driving by less than 3·10⁻⁴ rad/s. Polygons of extremals once
/// missed positions by 406 mm, 7.8 mm and 2.3 mm.
#[test]
fn bounds_that_graze_straight_driving_hide_nothing() {
    let no_choice = (0.465_381_676_936_683_53, 0.465_381_676_936_683_53);
    let wide = (-0.130_276_498_736_360_38, 0.316_720_342_913_721_53);
    let left = (0.193_683_465_289_635_2, 0.396_368_694_413_801_74);
    let cases = [
        spelt("baaabbbababaaaaaaababbb", &[(-0.5, -2.148_418_786_794_000_3e-4), left]),
        spelt(
            "bbccababaabcbbaccacbacbcbbccbccbacacbabaaccaccbab",
            &[(-0.5, -2.738_913_220_733_738_4e-4), wide, no_choice],
        ),
        spelt(
            "cbbacccaaaababbbbabcbacaccccacbbacaccbacabccba",
            &[
                (-0.5, -2.629_345_191_563_982e-4),
                (-0.497_370_190_357_202_54, 0.048_178_684_377_71),
                (0.389_948_264_319_287_75, 0.389_948_264_319_287_75),
            ],
        ),
    ];
    for case in cases {
        println!("{:.2} of the accuracy", check(&case, 1e-3));
    }
}

#[test]
fn polygons_of_extremals_pass_inside_no_position_by_more_than_their_accuracy() {
    let mut rng = SeededRng::new(71);
    let mut most = 0.0_f64;
    for _ in 0..150 {
        let bound = |_| {
            let (a, b) = (rng.uniform(-0.5, 0.5), rng.uniform(-0.5, 0.5));
            match rng.below(6) {
                0 => (a, a),
                1 => (-0.5, 0.5),
                2 => (a.min(0.0), a.max(0.0)),
                _ => (a.min(b), a.max(b)),
            }
        };
        let (lo, hi): (Vec<_>, Vec<_>) = (0..8).map(bound).unzip();
        most = most.max(check(&set(Pose::new(0.0, 0.0, 0.0), &lo, &hi), 1e-4));
    }
    println!("{most:.2} of the accuracy at most");
    for _ in 0..8 {
        let Bounds { lo, hi } = Bounds::hard(&mut rng, 30);
        check(&set(Pose::new(0.0, 0.0, 0.0), &lo, &hi), 1e-3);
    }
}
