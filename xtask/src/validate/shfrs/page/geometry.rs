//! The sections about sets.

use super::{kind, mm};
use crate::validate::shfrs::report::{Case, Kind, Membership, Report, Twin, Twins};
use crate::validate::words::{head, minus, power, thousands};

pub(super) fn vectors(cases: &[Case]) -> String {
    let mut rows = vec![head(
        "case | bounds | steps | area, of its tolerance | box, mm | boundary, mm | allowed, mm | margin, mm | positions | wrong | states | wrong",
        2,
    )];
    for case in cases {
        rows.push(format!(
            "| {}{} | {} | {} | {:.3} | {} | {} | {} | {} | {} | {} | {} | {} |",
            case.id,
            if case.coarse_rear_m.is_some() { "\\*" } else { "" },
            case.bounds,
            case.steps,
            case.area,
            mm(case.box_m),
            mm(case.boundary_m),
            1000.0 * case.boundary_allowed_m,
            mm(case.margin_m),
            case.planar.decided,
            case.planar.wrong,
            case.full.decided,
            case.full.wrong,
        ));
    }
    let box_allowed = cases.first().map_or(f64::NAN, |case| case.box_allowed_m);
    let coarse = cases.iter().find_map(|case| Some((case.id, case.coarse_rear_m?)));
    let coarse = coarse.map_or_else(String::new, |(id, metres)| {
        format!(
            "
\\* The reference of case {id} joins the ends of paths that jump at thirds of a step by straight
chords. These lie up to {} mm behind the true rear, more than the tolerance; our set was given the
same chords for this comparison (but not for margins and queries).
",
            mm(metres)
        )
    });
    format!(
        "## Reference cases

Twelve families of bounds, computed by an independent prototype that comes with tolerances
(`shared/tests/data/shfrs_vectors.json`). Worst over all steps and the tube: error of the area as
a share of its tolerance, of the bounding box ({} mm allowed), of the reference's boundary points,
and of the distance of queried positions from the boundary. Then queried positions, and full states
(position and heading) that the reference decides, and how many of them come out otherwise.

{}
{coarse}",
        1000.0 * box_allowed,
        rows.join("\n")
    )
}

pub(super) fn brute_force(report: &Report) -> String {
    let polygons = &report.polygons;
    let mut conservative = vec![head(
        "bounds | drives | positions | least margin, mm | compared | sticks out, mm | too large, cm² | too large, %",
        1,
    )];
    for of in &polygons.kinds {
        conservative.push(format!(
            "| {} | {} | {} | {} | {} | {} | {:.1} | {:.2} |",
            kind(of.kind),
            thousands(of.drives),
            thousands(of.positions),
            mm(of.least_margin_m),
            of.compared,
            mm(of.excess_m),
            1e4 * of.excess_m2,
            100.0 * of.excess_share,
        ));
    }
    let mut enumerated =
        vec![head("bounds | steps | sets | inputs | boundary points | farthest, mm", 1)];
    for of in &report.enumeration {
        enumerated.push(format!(
            "| {} | {} | {} | {} | {} | {} |",
            kind(of.kind),
            of.steps,
            of.bounds,
            thousands(of.inputs),
            thousands(of.points),
            mm(of.farthest_m),
        ));
    }
    let drives: usize = polygons.kinds.iter().map(|of| of.drives).sum();
    let closed = &report.closed_form;
    let (found, exact) = closed.everything_m2;
    format!(
        "## Brute force

**Nothing admissible leaves a conservative polygon.** {} random drives, under random bounds of up
to 15 steps, from poses and from uncertain starts (a disc, a box, a range of headings). Positions
at random times are looked up in the tube, and those after half and all of the steps in the sets of
these steps; a margin below 0 would be outside. Polygons are drawn to {} mm; how far they stick out
of exact ones (drawn to a tenth of that), and by how much they are larger (in % where the set has
0.1 m² or more), is what being sure costs.

Bounds made to be hard are another matter: of 7,200, with up to 50 steps, many without choice or
within 10⁻³ rad/s of admitting straight driving, one set missed drives that get as far as can be by
more than the accuracy, 4.4 mm at 50 steps, and conservative polygons may share that
([decision 0007](../decisions/0007-reachable-sets.md)). This is open.

{}

**Everything on the boundary is reached.** Inputs with two jumps among the lowest rate, the highest
and the one nearest to straight: every combination, with jumps at fractions of a step, and the
nearest ones then moved to the boundary point. Over three steps this reaches all of the boundary
for any bounds, over ten where straight is always admitted. Distance of the farthest boundary point
from an end:

{}

**Areas.** Where straight is always admitted the tube has a closed form. Against it, the polygons
of {} random bounds of up to {} steps, drawn to {} mm, are off by {} m² at most ({} of the
area). Everything that can be reached in ten steps has {exact:.4} m², the polygon {found:.4} m².
",
        thousands(drives),
        1000.0 * polygons.accuracy_m,
        conservative.join("\n"),
        enumerated.join("\n"),
        thousands(closed.bounds),
        closed.steps,
        1000.0 * closed.accuracy_m,
        power(closed.worst_m2),
        power(closed.worst_share),
    )
}

pub(super) fn twin(twins: &Twins) -> String {
    let mut rows = vec![head(
        "turn rates, rad/s | spacing, m | nodes | level set, m² | exact, m² | ratio | outside, mm",
        1,
    )];
    for twin in &twins.twins {
        let Twin { turn_rate_radps: (lo, hi), nodes: [x, y, psi], .. } = twin;
        rows.push(minus(format!(
            "| {lo} to {hi} | {} | {x}×{y}×{psi} | {:.3} | {:.3} | {:.3} | {} |",
            twin.spacing_m,
            twin.area_m2,
            twin.exact_m2,
            twin.area_m2 / twin.exact_m2,
            mm(twin.outside_m),
        )));
    }
    format!(
        "## The level-set solver as an independent twin

The Cartesian solver (see [value functions](reachability.md)) finds the same tubes on a grid: what
is reached within {} s from a disc of {} m, with headings within ±{} rad. A level set on a grid
cannot begin from a point. Its shadow, the nodes from which some heading is reached, is compared
with the exact tube of the same uncertain start. *Outside* is how far a node of the shadow lies
outside the exact tube at most, which is drawn to 0.1 mm (where a node lies on the rim of the start,
it is its edge that is seen). The finer the grid, the nearer it comes, from inside.

{}
",
        twins.horizon_s,
        twins.start_radius_m,
        twins.start_heading_rad,
        rows.join("\n")
    )
}

pub(super) fn membership(membership: &Membership) -> String {
    let steps: Vec<usize> = {
        let of = membership.rows.iter().filter(|row| row.kind == Kind::Everything);
        of.map(|row| row.steps).collect()
    };
    let titles: Vec<_> = steps.iter().map(|steps| format!("{steps} steps")).collect();
    let mut rows = vec![head(&format!("bounds | {}", titles.join(" | ")), 1)];
    for of in membership.rows.chunk_by(|a, b| a.kind == b.kind) {
        let cell = |row: &super::super::report::MembershipRow| match row.outside {
            0 => "0".to_owned(),
            outside => format!("{outside} ({} mm)", mm(row.farthest_m)),
        };
        let cells: Vec<_> = of.iter().map(cell).collect();
        rows.push(format!("| {} | {} |", kind(of[0].kind), cells.join(" | ")));
    }
    let drives: usize = membership.rows.iter().map(|row| row.drives).sum();
    let each = membership.rows.first().map_or(0, |row| row.drives);
    format!(
        "## Membership of full states

Is a state, position and heading, reached after so many steps? {} random admissible drives, {} in
each cell, end in states that are. How many of these are found outside all the same, at the usual
tolerance of {} mm and {} mrad, and by how much at most:

{}
",
        thousands(drives),
        thousands(each),
        1000.0 * membership.tolerance_m,
        1000.0 * membership.tolerance_rad,
        rows.join("\n")
    )
}
