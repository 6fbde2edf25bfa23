//! Callers can cancel computations on sets.

use super::{origin, set};
use core::ops::ControlFlow;
use sidestep::bounds::InputBounds;
use sidestep::math::PI;
use sidestep::reach::{
    Cancelled, Membership, PolygonSettings, Progress, ReachableSet, StartSet, Tolerance, Workspace,
};
use sidestep::vehicle::Pose;

/// A set whose polygons exceed the work limit.
fn laborious() -> ReachableSet {
    let bounds = InputBounds::new(vec![-PI; 100], vec![PI; 100], (-PI, PI)).unwrap();
    ReachableSet::new(origin(), &bounds, 2.0, 1.0).unwrap()
}

/// Cancels the work after the given number of reports, and stores the last report.
fn after(reports: usize, last: &mut Option<Progress>) -> impl FnMut(Progress) -> ControlFlow<()> {
    let mut left = reports;
    move |now| {
        assert!(last.is_none_or(|last| last.done < now.done) && now.done <= now.of, "{now:?}");
        *last = Some(now);
        if left == 0 {
            return ControlFlow::Break(());
        }
        left -= 1;
        ControlFlow::Continue(())
    }
}

#[test]
fn a_polygon_that_is_cancelled_stays_as_it_was() {
    let set = laborious();
    let exact = PolygonSettings::default();
    for settings in [exact, exact.conservative()] {
        for (reports, tube) in [(0, true), (0, false), (3, true), (3, false)] {
            let (mut workspace, mut polygon) = (Workspace::default(), vec![[1.0, 2.0]]);
            let mut last = None;
            let mut progress = after(reports, &mut last);
            let found = if tube {
                set.try_tube_polygon_into(settings, &mut workspace, &mut polygon, &mut progress)
            } else {
                set.try_step_polygon_into(
                    100,
                    settings,
                    &mut workspace,
                    &mut polygon,
                    &mut progress,
                )
            };
            drop(progress);
            assert_eq!(found, Err(Cancelled));
            assert_eq!(polygon, [[1.0, 2.0]]);
            let Progress { done, of } = last.expect("a report");
            assert_eq!(of, settings.most_work());
            // Reports are frequent, so little of the work is done when the work is cancelled.
            assert!(done < of / 2, "{done} of {of}");
        }
    }
}

#[test]
fn reports_change_nothing_else() {
    let go_on = &mut |_: Progress| ControlFlow::Continue(());
    let (mut workspace, mut polygon) = (Workspace::default(), Vec::new());
    let exact = PolygonSettings::default();
    for set in [laborious(), set(origin(), &[-0.5, 0.1, 0.0], &[0.2, 0.4, 0.3])] {
        for settings in [exact, exact.conservative()] {
            set.try_tube_polygon_into(settings, &mut workspace, &mut polygon, go_on).unwrap();
            assert_eq!(polygon, set.tube_polygon(settings));
            let step = set.steps();
            set.try_step_polygon_into(step, settings, &mut workspace, &mut polygon, go_on).unwrap();
            assert_eq!(polygon, set.step_polygon(step, settings));
        }
        let state = Pose::new(0.9, 0.5, 2.0);
        let (step, tolerance) = (set.steps(), Tolerance::default());
        let found = set.try_state_membership(step, state, tolerance, 24, go_on);
        assert_eq!(found, Ok(set.state_membership(step, state, tolerance, 24)));
    }
}

#[test]
fn a_question_of_membership_is_cancelled() {
    let set = laborious();
    // A state that is hard to decide, because it is almost as far away as the vehicle can get.
    let state = Pose::new(199.9, 0.0, 3.0);
    for reports in [0, 5] {
        let mut last = None;
        let mut progress = after(reports, &mut last);
        let found = set.try_state_membership(100, state, Tolerance::default(), 1000, &mut progress);
        assert_eq!(found, Err(Cancelled));
    }
}

/// Every query stays within the work limit. States that are not decided within the limit stay open.
#[test]
fn the_work_on_a_state_is_bounded() {
    let bounds = InputBounds::new(vec![-PI; 100], vec![PI; 100], (-PI, PI)).unwrap();
    let unsure = StartSet::new(
        origin(),
        sidestep::reach::PositionUncertainty::Box { along_m: 1.0, across_m: 0.5 },
        0.3,
    );
    let set = ReachableSet::new(unsure.unwrap(), &bounds, 2.0, 1.0).unwrap();
    let state = Pose::new(60.0, 20.0, 1.0);
    let mut most = 0;
    let progress = &mut |now: Progress| {
        most = now.done;
        assert!(now.done <= now.of);
        ControlFlow::Continue(())
    };
    let found =
        set.try_state_membership(100, state, Tolerance::default(), usize::MAX, progress).unwrap();
    assert_ne!(found, Membership::Outside);
    assert!(most > 0);
}
