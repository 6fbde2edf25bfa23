//! The reference cases: twelve families of bounds, computed by an independent prototype.

use std::error::Error;

use serde::{Deserialize, Serialize};
use sidestep::bounds::InputBounds;
use sidestep::reach::polygon::{bounding_box, signed_area, signed_distance};
use sidestep::reach::{PolygonSettings, ReachableSet, Tolerance};
use sidestep::vehicle::{Pose, dubins};

use crate::{SPEED_MPS, STEP_S};

/// One case: worst errors over its steps and its tube.
#[derive(Serialize)]
pub(crate) struct Case {
    id: usize,
    bounds: String,
    steps: usize,
    /// Error of an area over its tolerance, which depends on the area.
    area: f64,
    /// Of a side of a bounding box, m, and what the reference allows.
    box_m: f64,
    box_allowed_m: f64,
    /// Of a point of the reference's boundary from ours, m.
    boundary_m: f64,
    boundary_allowed_m: f64,
    /// Of the signed distance of a queried position from the boundary, m.
    margin_m: f64,
    /// Queried positions and full states: how many the reference decides, and how many of
    /// these we decide otherwise.
    planar: Queries,
    full: Queries,
    /// In the case whose reference rear is drawn with coarse chords: by how much reference
    /// points lie outside the true set. Boundary errors are then against our set with the
    /// same chords.
    coarse_rear_m: Option<f64>,
}

#[derive(Default, Serialize)]
pub(crate) struct Queries {
    decided: usize,
    wrong: usize,
}

impl Queries {
    fn add(&mut self, agrees: bool) {
        self.decided += 1;
        self.wrong += usize::from(!agrees);
    }
}

#[derive(Deserialize)]
struct Vectors {
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
}

#[derive(Deserialize)]
struct Query {
    step: usize,
    state: Pose,
    planar_in: bool,
    planar_margin: f64,
    full_in: Option<bool>,
}

/// The file's own tolerances: of boxes, m, and of queries, m and rad.
const BOX_M: f64 = 1e-3;
const QUERY: Tolerance = Tolerance { position_m: 1e-3, heading_rad: 1e-3 };

/// The case whose reference rear joins the ends of paths that jump at thirds of a step by
/// straight chords; these lie behind the true rear.
const COARSE_REAR: usize = 4;

impl Reference {
    /// The file's own tolerances: (area, m², boundary, m).
    fn allowed(&self, area: f64) -> (f64, f64) {
        match (self.zero_in_all, self.steps_count) {
            (true, _) => (1e-4 + 1e-3 * area, 3e-4),
            (false, 25) => (2e-4 + 1e-2 * area, 1e-2),
            (false, _) => (2e-4 + 5e-3 * area, 1e-3),
        }
    }

    /// Our polygon, with its rear drawn as the reference's.
    fn with_coarse_rear(&self, polygon: &[[f64; 2]], step: usize) -> Vec<[f64; 2]> {
        // The path at the highest rates for so many thirds of a step, then at the lowest.
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
            box_m: 0.0,
            box_allowed_m: BOX_M,
            boundary_m: 0.0,
            boundary_allowed_m: reference.allowed(0.0).1,
            margin_m: 0.0,
            planar: Queries::default(),
            full: Queries::default(),
            coarse_rear_m: None,
        };
        let settings = PolygonSettings::default();
        let mut polygons = vec![set.step_polygon(0, settings)];
        for step in &reference.steps {
            let own = set.step_polygon(step.i, settings);
            let points = || step.boundary.iter().chain(&step.front);
            if reference.id == COARSE_REAR {
                let outside = points().map(|&p| -signed_distance(&own, p)).fold(0.0, f64::max);
                case.coarse_rear_m = Some(case.coarse_rear_m.unwrap_or(0.0).max(outside));
                let drawn = reference.with_coarse_rear(&own, step.i);
                case.compare(reference, &drawn, step.area, step.bbox, points());
            } else {
                case.compare(reference, &own, step.area, step.bbox, points());
            }
            polygons.push(own);
        }
        let tube = set.tube_polygon(settings);
        let Tube { area, bbox, boundary } = &reference.tube;
        case.compare(reference, &tube, *area, *bbox, boundary.iter());
        for query in &reference.queries {
            let margin = signed_distance(&polygons[query.step], query.state.position());
            case.planar.add((margin >= -QUERY.position_m) == query.planar_in);
            case.margin_m = case.margin_m.max((margin - query.planar_margin).abs());
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

pub(crate) fn check() -> Result<Vec<Case>, Box<dyn Error>> {
    let text = include_str!("../../tests/data/shfrs_vectors.json");
    let vectors: Vectors = serde_json::from_str(text)?;
    let range = (vectors.w_min, vectors.w_max);
    let case = |reference: &Reference| {
        let bounds = InputBounds::new(reference.lo.clone(), reference.hi.clone(), range)?;
        let set = ReachableSet::new(reference.x0, &bounds, SPEED_MPS, STEP_S)?;
        Ok(Case::of(reference, &set))
    };
    vectors.cases.iter().map(case).collect()
}
