//! What the library's example `validate_shfrs` prints. Units and meanings are stated there.

use serde::Deserialize;

#[derive(Deserialize)]
pub(super) struct Report {
    pub(super) vectors: Vec<Case>,
    pub(super) polygons: Polygons,
    pub(super) enumeration: Vec<Enumeration>,
    pub(super) closed_form: ClosedForm,
    pub(super) twin: Twins,
    pub(super) membership: Membership,
    pub(super) coverage: Coverage,
    pub(super) danger: Danger,
    pub(super) families: Families,
}

#[derive(Deserialize)]
pub(super) struct Case {
    pub(super) id: usize,
    pub(super) bounds: String,
    pub(super) steps: usize,
    pub(super) area: f64,
    pub(super) box_m: f64,
    pub(super) box_allowed_m: f64,
    pub(super) boundary_m: f64,
    pub(super) boundary_allowed_m: f64,
    pub(super) margin_m: f64,
    pub(super) planar: Queries,
    pub(super) full: Queries,
    pub(super) coarse_rear_m: Option<f64>,
}

#[derive(Deserialize)]
pub(super) struct Queries {
    pub(super) decided: usize,
    pub(super) wrong: usize,
}

/// What bounds admit.
#[derive(Clone, Copy, Deserialize, PartialEq)]
#[serde(rename_all = "snake_case")]
pub(super) enum Kind {
    Everything,
    Straight,
    OneSide,
    Any,
}

#[derive(Deserialize)]
pub(super) struct Polygons {
    pub(super) accuracy_m: f64,
    pub(super) kinds: Vec<PolygonsOfKind>,
}

#[derive(Deserialize)]
pub(super) struct PolygonsOfKind {
    pub(super) kind: Kind,
    pub(super) drives: usize,
    pub(super) positions: usize,
    pub(super) least_margin_m: f64,
    pub(super) compared: usize,
    pub(super) excess_m: f64,
    pub(super) excess_m2: f64,
    pub(super) excess_share: f64,
}

#[derive(Deserialize)]
pub(super) struct Enumeration {
    pub(super) kind: Kind,
    pub(super) steps: usize,
    pub(super) bounds: usize,
    pub(super) inputs: usize,
    pub(super) points: usize,
    pub(super) farthest_m: f64,
}

#[derive(Deserialize)]
pub(super) struct ClosedForm {
    pub(super) bounds: usize,
    pub(super) steps: usize,
    pub(super) accuracy_m: f64,
    pub(super) worst_m2: f64,
    pub(super) worst_share: f64,
    pub(super) everything_m2: (f64, f64),
}

#[derive(Deserialize)]
pub(super) struct Twins {
    pub(super) start_radius_m: f64,
    pub(super) start_heading_rad: f64,
    pub(super) horizon_s: f64,
    pub(super) twins: Vec<Twin>,
}

#[derive(Deserialize)]
pub(super) struct Twin {
    pub(super) turn_rate_radps: (f64, f64),
    pub(super) spacing_m: f64,
    pub(super) nodes: [usize; 3],
    pub(super) area_m2: f64,
    pub(super) exact_m2: f64,
    pub(super) outside_m: f64,
}

#[derive(Deserialize)]
pub(super) struct Membership {
    pub(super) tolerance_m: f64,
    pub(super) tolerance_rad: f64,
    pub(super) rows: Vec<MembershipRow>,
}

#[derive(Deserialize)]
pub(super) struct MembershipRow {
    pub(super) kind: Kind,
    pub(super) steps: usize,
    pub(super) drives: usize,
    pub(super) outside: usize,
    pub(super) farthest_m: f64,
}

#[derive(Deserialize)]
pub(super) struct Coverage {
    pub(super) population: usize,
    pub(super) calibrations: usize,
    pub(super) delta: f64,
    pub(super) levels: usize,
    pub(super) not_nested: usize,
    pub(super) rows: Vec<CoverageRow>,
}

#[derive(Deserialize)]
pub(super) struct CoverageRow {
    pub(super) p: f64,
    pub(super) n: usize,
    pub(super) conformal_mean: f64,
    pub(super) conformal_error: f64,
    pub(super) conformal_expected: f64,
    pub(super) pac_failures: Option<f64>,
    pub(super) fixed_failures: Option<f64>,
    pub(super) pac_needs: usize,
}

#[derive(Deserialize)]
pub(super) struct Danger {
    pub(super) scenes: usize,
    pub(super) calibration: usize,
    pub(super) low: f64,
    pub(super) entered: f64,
    pub(super) high: f64,
    pub(super) narrow: f64,
    pub(super) rows: Vec<DangerRow>,
}

#[derive(Deserialize)]
pub(super) struct DangerRow {
    pub(super) alpha: f64,
    pub(super) entered_against: f64,
    pub(super) stayed_out_against: f64,
    pub(super) said_out: f64,
    pub(super) said_in: f64,
}

#[derive(Deserialize)]
pub(super) struct Families {
    pub(super) drives: usize,
    pub(super) training: usize,
    pub(super) calibration: usize,
    pub(super) test: usize,
    pub(super) splits: usize,
    pub(super) steps: usize,
    pub(super) targets: Vec<f64>,
    pub(super) confidence: f64,
    pub(super) families: Vec<Family>,
}

#[derive(Deserialize)]
pub(super) struct Family {
    pub(super) family: String,
    pub(super) cells: Vec<Cell>,
}

#[derive(Deserialize)]
pub(super) struct Cell {
    pub(super) area_m2: f64,
    pub(super) coverage: f64,
    pub(super) low: f64,
    pub(super) high: f64,
}
