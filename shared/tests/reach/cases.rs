//! The twelve reference cases of reachable sets (`tests/data/README.md`), and the deviations of our
//! sets from them. A test bounds these numbers; `cargo xtask validate shfrs` prints them.

use serde::{Deserialize, Serialize};
use sidestep::bounds::InputBounds;
use sidestep::reach::polygon::{bounding_box, signed_area, signed_distance};
use sidestep::reach::{PolygonSettings, ReachableSet, Tolerance};
use sidestep::vehicle::{Pose, dubins};

/// One case, with the maximum errors over its steps and its tube.
#[derive(Debug, Serialize)]
pub(crate) struct Case {
    pub(crate) id: usize,
    bounds: String,
    steps: usize,
    /// Error of an area, divided by its tolerance. The tolerance depends on the area.
    pub(crate) area: f64,
    /// Error of our tube's area compared with its closed form, divided by the same tolerance. Only
    /// computed if straight driving is always admissible.
    pub(crate) closed_form_area: f64,
    /// Error of a side of a bounding box (m), and its tolerance in the reference.
    pub(crate) box_m: f64,
    pub(crate) box_allowed_m: f64,
    /// Distance of a point on the reference's boundary from our boundary (m), and its tolerance.
    pub(crate) boundary_m: f64,
    pub(crate) boundary_allowed_m: f64,
    /// How far a point on the reference's boundary is inside our set (m).
    pub(crate) inside_m: f64,
    /// Error of the signed distance of a queried position from the boundary (m).
    pub(crate) margin_m: f64,
    /// How far a reachable queried position is outside our tube (m).
    pub(crate) outside_tube_m: f64,
    /// Queries of positions, and of full states.
    pub(crate) planar: Queries,
    pub(crate) full: Queries,
    /// Only for the case in which the reference draws the rear boundary with coarse chords: how far
    /// points of this boundary are outside the true set (m). In this case, `boundary_m` compares
    /// the reference with our set drawn with the same chords.
    pub(crate) coarse_rear_m: Option<f64>,
}

/// Number of queries that the reference decides, and the number of them that we decide differently.
#[derive(Debug, Default, Serialize)]
pub(crate) struct Queries {
    pub(crate) decided: usize,
    pub(crate) wrong: usize,
}

impl Queries {
    fn add(&mut self, agrees: bool) {
        self.decided += 1;
        self.wrong += usize::from(!agrees);
    }
}

#[derive(Deserialize)]
struct Vectors {
    v: f64,
    dt: f64,
    w_min: f64,
    w_max: f64,
    cases: Vec<Reference>,
}

#[derive(Deserialize)]
struct Reference {
    id: usize,
    kind: String,
    #[serde(rename = "T")]
    steps_count: usize,
    x0: Pose,
    lo: Vec<f64>,
    hi: Vec<f64>,
    zero_in_all: bool,
    steps: Vec<StepSet>,
    tube: Tube,
    queries: Vec<Query>,
}

#[derive(Deserialize)]
struct StepSet {
    i: usize,
    area: f64,
    bbox: [f64; 4],
    boundary: Vec<[f64; 2]>,
    front: Vec<[f64; 2]>,
}

#[derive(Deserialize)]
struct Tube {
    area: f64,
    bbox: [f64; 4],
    boundary: Vec<[f64; 2]>,
    closed_form_area: f64,
}

#[derive(Deserialize)]
struct Query {
    step: usize,
    state: Pose,
    planar_in: bool,
    planar_margin: f64,
    full_in: Option<bool>,
}

const SPEED_MPS: f64 = 2.0;
const STEP_S: f64 = 0.2;

/// The file's own tolerances, for boxes (m) and for queries (m, rad).
const BOX_M: f64 = 1e-3;
const QUERY: Tolerance = Tolerance { position_m: 1e-3, heading_rad: 1e-3 };

/// Id of the case in which the reference draws the rear boundary with straight chords between the
/// ends of paths that switch from the highest to the lowest rate at thirds of a step. The chords
/// are behind the true rear boundary by more than the file's tolerance. Positions between the two
/// are not reachable, as the random inputs in `properties.rs` show.
const COARSE_REAR: usize = 4;

impl Reference {
    /// The file's own tolerances for an area (m²) and for the boundary (m).
    fn allowed(&self, area: f64) -> (f64, f64) {
        match (self.zero_in_all, self.steps_count) {
            (true, _) => (1e-4 + 1e-3 * area, 3e-4),
            (false, 25) => (2e-4 + 1e-2 * area, 1e-2),
            (false, _) => (2e-4 + 5e-3 * area, 1e-3),
        }
    }

    /// Our polygon, with its rear boundary drawn with the reference's chords.
    fn with_coarse_rear(&self, polygon: &[[f64; 2]], step: usize) -> Vec<[f64; 2]> {
        // The end of the path that has the highest rates for the first `thirds` thirds of a step,
        // and then the lowest rates.
        let end = |thirds: usize| {
            let pose = (0..3 * step).fold(self.x0, |pose, third| {
                let rates = if third < thirds { &self.hi } else { &self.lo };
                dubins::arc(pose, SPEED_MPS, rates[third / 3], STEP_S / 3.0)
            });
            pose.position()
        };
        let corner = end(3 * step);
        let distance = |p: &[f64; 2]| (p[0] - corner[0]).abs() + (p[1] - corner[1]).abs();
        let at_corner = (0..polygon.len())
            .min_by(|&i, &j| distance(&polygon[i]).total_cmp(&distance(&polygon[j])))
            .unwrap_or(0);
        let front = polygon.iter().take(at_corner + 1).copied();
        front.chain((1..3 * step).rev().map(end)).collect()
    }
}

impl Case {
    fn of(reference: &Reference, set: &ReachableSet) -> Self {
        let mut case = Self {
            id: reference.id,
            bounds: reference.kind.clone(),
            steps: reference.steps_count,
            area: 0.0,
            closed_form_area: 0.0,
            box_m: 0.0,
            box_allowed_m: BOX_M,
            boundary_m: 0.0,
            boundary_allowed_m: reference.allowed(0.0).1,
            inside_m: 0.0,
            margin_m: 0.0,
            outside_tube_m: 0.0,
            planar: Queries::default(),
            full: Queries::default(),
            coarse_rear_m: None,
        };
        let settings = PolygonSettings::default();
        let mut polygons = vec![set.step_polygon(0, settings)];
        for step in &reference.steps {
            let own = set.step_polygon(step.i, settings);
            let points = || step.boundary.iter().chain(&step.front);
            let margins = || points().map(|&point| -signed_distance(&own, point));
            case.inside_m = margins().fold(case.inside_m, f64::max);
            if reference.id == COARSE_REAR {
                let outside = margins().map(|margin| -margin).fold(0.0, f64::max);
                case.coarse_rear_m = Some(case.coarse_rear_m.unwrap_or(0.0).max(outside));
                let drawn = reference.with_coarse_rear(&own, step.i);
                case.compare(reference, &drawn, step.area, step.bbox, points());
            } else {
                case.compare(reference, &own, step.area, step.bbox, points());
            }
            polygons.push(own);
        }
        let tube = set.tube_polygon(settings);
        let Tube { area, bbox, boundary, closed_form_area } = &reference.tube;
        case.compare(reference, &tube, *area, *bbox, boundary.iter());
        if reference.zero_in_all {
            let error = (signed_area(&tube) - closed_form_area).abs();
            case.closed_form_area = error / reference.allowed(*area).0;
        }
        for query in &reference.queries {
            let position = query.state.position();
            let margin = -signed_distance(&polygons[query.step], position);
            case.planar.add((margin >= -QUERY.position_m) == query.planar_in);
            case.margin_m = case.margin_m.max((margin - query.planar_margin).abs());
            if query.planar_in {
                case.outside_tube_m = case.outside_tube_m.max(signed_distance(&tube, position));
            }
            if let Some(inside) = query.full_in {
                case.full.add(set.contains_state(query.step, query.state, QUERY) == inside);
            }
        }
        case
    }

    fn compare<'a>(
        &mut self,
        reference: &Reference,
        polygon: &[[f64; 2]],
        area: f64,
        bbox: [f64; 4],
        points: impl Iterator<Item = &'a [f64; 2]>,
    ) {
        let (allowed, _) = reference.allowed(area);
        self.area = self.area.max((signed_area(polygon) - area).abs() / allowed);
        let found = bounding_box(polygon).unwrap_or([f64::INFINITY; 4]);
        self.box_m = found.iter().zip(bbox).map(|(a, b)| (a - b).abs()).fold(self.box_m, f64::max);
        self.boundary_m =
            points.map(|&p| signed_distance(polygon, p).abs()).fold(self.boundary_m, f64::max);
    }
}

/// Compares every case of the file.
pub(crate) fn measured() -> Vec<Case> {
    let vectors: Vectors =
        serde_json::from_str(include_str!("../data/shfrs_vectors.json")).expect("the data parses");
    assert_eq!((vectors.v, vectors.dt), (SPEED_MPS, STEP_S));
    let range = (vectors.w_min, vectors.w_max);
    let case = |reference: &Reference| {
        let bounds = InputBounds::new(reference.lo.clone(), reference.hi.clone(), range);
        let bounds = bounds.expect("bounds");
        let set = ReachableSet::new(reference.x0, &bounds, SPEED_MPS, STEP_S).expect("a set");
        Case::of(reference, &set)
    };
    vectors.cases.iter().map(case).collect()
}
