//! Reachable sets, compared with the reference cases.

use super::cases;

/// Allowed distance of a point of the coarse rear boundary outside the true set (m).
const COARSE_CHORD_M: f64 = 1.4e-3;

#[test]
fn sets_are_those_of_the_reference() {
    let cases = cases::measured();
    assert_eq!(cases.len(), 12);
    for case in &cases {
        assert!(case.area <= 1.0 && case.closed_form_area <= 1.0, "{case:?}");
        assert!(case.box_m <= case.box_allowed_m, "{case:?}");
        assert!(case.boundary_m <= case.boundary_allowed_m, "{case:?}");
        assert!(case.inside_m <= case.boundary_allowed_m, "{case:?}");
        if let Some(outside) = case.coarse_rear_m {
            assert!(case.boundary_allowed_m < outside && outside < COARSE_CHORD_M, "{case:?}");
        }
    }
    assert_eq!(cases.iter().filter(|case| case.coarse_rear_m.is_some()).count(), 1);
}

#[test]
fn queries_are_decided_as_by_the_reference() {
    for case in cases::measured() {
        let margin = case.coarse_rear_m.map_or(case.boundary_allowed_m, |_| COARSE_CHORD_M);
        assert!(case.margin_m <= margin, "{case:?}");
        assert!(case.outside_tube_m <= 1e-3, "{case:?}");
        assert!(case.planar.decided >= 200 && case.planar.wrong == 0, "{case:?}");
        assert!(case.full.decided >= 135 && case.full.wrong == 0, "{case:?}");
    }
}
