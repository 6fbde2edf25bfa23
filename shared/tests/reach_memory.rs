//! Once its buffers exist, drawing a polygon allocates nothing. The test counts allocations of the
//! whole process. Therefore it runs without the test harness and its threads.
#![allow(clippy::unwrap_used, reason = "a test that panics has failed")]

use peak_alloc::PeakAlloc;
use sidestep::bounds::InputBounds;
use sidestep::reach::{PolygonSettings, PositionUncertainty, ReachableSet, StartSet, Workspace};
use sidestep::vehicle::Pose;

#[global_allocator]
static MEMORY: PeakAlloc = PeakAlloc;

fn main() {
    let bounds: Vec<InputBounds> = [(-0.5, 0.5), (0.1, 0.4), (-0.5, -0.2), (0.0, 0.0)]
        .into_iter()
        .map(|(lo, hi)| {
            let (mut lo, mut hi) = (vec![lo; 10], vec![hi; 10]);
            (lo[0], hi[0]) = (-0.5, 0.5);
            (lo[7], hi[7]) = (-0.3, -0.1);
            InputBounds::new(lo, hi, (-0.5, 0.5)).expect("bounds")
        })
        .collect();
    let pose = Pose::new(1.0, 2.0, 0.5);
    let disc = PositionUncertainty::Disc { radius_m: 0.3 };
    let starts = [pose.into(), StartSet::new(pose, disc, 0.1).expect("a start")];
    let settings = PolygonSettings::new(1e-3, 4).expect("settings");
    let mut set = ReachableSet::new(pose, &bounds[0], 2.0, 0.2).expect("a set");
    let (mut workspace, mut polygon) = (Workspace::default(), Vec::new());
    let mut every_polygon = || {
        let mut vertices = 0;
        for (start, bounds) in starts.iter().flat_map(|s| bounds.iter().map(move |b| (*s, b))) {
            set.reset(start, bounds).expect("a set");
            for settings in [settings, settings.conservative()] {
                for step in 0..=10 {
                    set.step_polygon_into(step, settings, &mut workspace, &mut polygon);
                    vertices += polygon.len();
                }
                set.tube_polygon_into(settings, &mut workspace, &mut polygon);
                vertices += polygon.len();
            }
        }
        vertices
    };
    MEMORY.reset_peak_usage();
    let before = MEMORY.peak_usage();
    let first = every_polygon();
    assert!(MEMORY.peak_usage() > before, "is anything counted?");
    // Any allocation, even a short-lived one, raises the peak above the current usage.
    MEMORY.reset_peak_usage();
    let before = MEMORY.peak_usage();
    assert_eq!(every_polygon(), first);
    assert_eq!(MEMORY.peak_usage(), before);
}
