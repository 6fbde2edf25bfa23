//! The page: what is solved, how it was measured and what came out.

use super::peers::{Peers, Solved};
use super::report::{
    Air3d, Cartesian, ClosedForm, ErrorMap, Errors, Game, Order, Polar, Report, Unequal,
};
use crate::validate::words::{cm, head, minus, power, seconds, thousands};

/// The whole page.
pub(super) fn page(report: &Report, peers: &Peers) -> String {
    let sections = [
        introduction(report),
        closed_form(&report.closed_form),
        slices(report),
        polar(report),
        cartesian(&report.cartesian),
        unequal(&report.unequal),
        side_by_side(peers),
        limits(report),
    ];
    sections.join("\n")
}

fn introduction(report: &Report) -> String {
    let games: Vec<_> =
        report.closed_form.iter().map(|form| (&form.game, &form.parameters)).collect();
    let mut rows = vec![head("game | vehicle | speed, m/s | turn rate, rad/s | R, m", 2)];
    let unequal = String::from("unequal");
    for (name, game) in games.into_iter().chain([(&unequal, &report.unequal.parameters)]) {
        rows.extend(game_rows(name, game));
    }
    format!(
        "# How good the value functions are

<!-- Written by `cargo xtask validate`: change that, not this file. -->

Two vehicles move at constant speed and choose their turn rates. The *evader* wants to keep its
distance, the *pursuer* wants to get near. V is the smallest distance that the evader can
guarantee from a state on, less the danger radius R: V ≤ 0 means that the pursuer can force a
collision. A state is the pursuer's position (x, y) in the evader's frame (x ahead, y to the
left, metres) and its heading ψ relative to the evader's.

V is found by a **closed form** (identical vehicles), by a **polar solver** (any vehicles, no
time limit) or by a **Cartesian solver** (any vehicles, any time horizon). This page measures all
three. `cargo xtask validate` computes every number and picture anew, in the same way each time;
only the comparison with other programs is kept from an earlier day, since it takes minutes.
Random states come from fixed seeds.

{}
",
        rows.join("\n")
    )
}

fn game_rows(name: &str, game: &Game) -> Vec<String> {
    let row = |who: &str, player: &super::report::Player| {
        format!(
            "| *{name}* | {who} | {} | {} | {} |",
            player.speed_mps, player.turn_rate_radps, game.radius_m
        )
    };
    let Game { evader, pursuer, .. } = game;
    if evader.speed_mps == pursuer.speed_mps && evader.turn_rate_radps == pursuer.turn_rate_radps {
        return vec![row("both", evader)];
    }
    vec![row("evader", evader), row("pursuer", pursuer)]
}

fn closed_form(forms: &[ClosedForm]) -> String {
    let games: Vec<_> = forms.iter().map(|form| format!("*{}*", form.game)).collect();
    let mut rows = vec![head(&format!("measured | {}", games.join(" | ")), 1)];
    let mut row = |what: &str, of: &dyn Fn(&ClosedForm) -> String| {
        let cells: Vec<_> = forms.iter().map(of).collect();
        rows.push(format!("| {what} | {} |", cells.join(" | ")));
    };
    let three = |errors: &Errors| [errors.p50, errors.p99, errors.max].map(power).join(" / ");
    row("residual, own gradient: p50 / p99 / max", &|form| three(&form.residual));
    row("residual, differences of V: p50 / p99 / max", &|form| {
        three(&form.residual_of_differences)
    });
    row("largest \\|V\\| on the reference barrier, m", &|form| {
        format!("{} ({} points)", power(form.barrier.max), form.barrier.count)
    });
    row("largest error at the reference states, m", &|form| {
        format!("{} ({} states)", power(form.reference.1), form.reference.0)
    });
    row("volume of {V ≤ 0}, m²·rad", &|form| {
        format!("{:.2} (reference {:.2})", form.volume, form.reference_volume)
    });
    let (count, closing) = forms.first().map_or((0, 0), |form| (form.residual.count, form.closing));
    format!(
        "## Closed form

V must satisfy min(r − R − V, H(x, ∇V)) = 0, where H is the rate of change of V when both play
their best. The residual of this equation was taken at {} random states (x and y within 6
turning radii, any ψ; at {} of them the range will shrink, so that the equation is H = 0). It is
in metres, or metres a second; once with the gradient that the closed form states, once with
central differences of V, which are independent of the formulas for the gradient. The barrier
{{V = 0}} and the values at reference states were found elsewhere (`shared/tests/data/README.md`);
the barrier's points are rounded to 10⁻⁶ m. The volume is by quadrature over 512 bearings and
256 headings.

{}
",
        thousands(count),
        thousands(closing),
        rows.join("\n")
    )
}

fn slices(report: &Report) -> String {
    let headings: Vec<_> = report.slices_deg.iter().map(|psi| format!("{psi:.0}°")).collect();
    format!(
        "## The same set three times

![Curves of V = 0 by closed form, polar and Cartesian solver at three relative headings, whole and enlarged](slices.svg)

{{V = 0}} of *mitchell* at ψ = {}, in the evader's frame. The evader is the arrow head; from
inside the curve the pursuer can force a collision. Below, the set's farthest point is enlarged ten
times. All three curves are zeros of V along rays from the evader. The curves that the program
draws are traced through the grid instead: on them (*mitchell*, polar, standard, 24 headings, their
points and the middles between these) |V| of the same solution is {} cm at the 99th percentile and
{} cm at most, where a tip is sharper than a cell.
",
        headings.join(", "),
        cm(report.traced.p99),
        cm(report.traced.max)
    )
}

fn polar(report: &Report) -> String {
    let mut rows = vec![head(
        "game | accuracy | nodes | p50 | p90 | p99 | max | at nodes: p99 | max | volume, % | sweeps | drift, mm",
        2,
    )];
    for polar in &report.polar {
        let Polar { game, accuracy, nodes: [range, angle], random, at_nodes, .. } = polar;
        rows.push(format!(
            "| *{game}* | {accuracy} | {range}×{angle}² | {} | {} | {} | {} | {} | {} | {:+.2} | {} | {:.2} |",
            cm(random.p50),
            cm(random.p90),
            cm(random.p99),
            cm(random.max),
            cm(at_nodes.p99),
            cm(at_nodes.max),
            polar.volume_percent,
            polar.sweeps,
            1000.0 * polar.drift_m,
        ));
    }
    let counts = |game: &str| {
        let of = report.polar.iter().find(|polar| polar.game == game);
        of.map_or((0, 0.0), |polar| (polar.random.count, polar.range_m))
    };
    let map = MapErrors::of(&report.error_map);
    let ((paper, paper_m), (mitchell, mitchell_m)) = (counts("paper"), counts("mitchell"));
    format!(
        "## Polar solver

The solver works in range, bearing and heading, out to {paper_m:.1} m (*paper*) and
{mitchell_m:.1} m (*mitchell*). Errors |V − closed form| are in **centimetres**, at those of
200,000 random states (range up to 5 turning radii, bearing, heading each uniform) that have
|V| < 0.5 m and whose range can be made smaller at all: {} and {} states. Elsewhere V = r − R is
stored exactly. *At nodes* are the stored numbers themselves, without interpolation. Nodes are
range × angle², sweeps those over the finest grid, drift is by how much V still moves in 16
sweeps.

{}

![Share of states with a larger error, against the error, for three accuracies](polar-errors.svg)

The same errors as a distribution: each line says what share of the states has a larger error.

![Map of the error at ψ = 180°](error-map.svg)

Where they are: *paper*, ψ = 180°, accuracy standard, at any V. In this picture the error is {} cm
at the median, {} cm at the 99th percentile and {} cm at most, at x = {:.1} m, y = {:.1} m; on y = 0
turning right and turning left are equally good for the evader, and V has a kink.
",
        thousands(paper),
        thousands(mitchell),
        rows.join("\n"),
        cm(map.p50),
        cm(map.p99),
        cm(map.max),
        map.worst.0,
        map.worst.1
    )
}

fn cartesian(cartesian: &Cartesian) -> String {
    let mut rows =
        vec![head("grid | Δx, m | scheme | cfl | steps | mean, Δx | max, Δx | volume, %", 1)];
    let row = |solve: &Air3d, scheme: &str, cfl: &str, steps: &str| {
        let [x, y, psi] = solve.nodes;
        let row = format!(
            "| {x}×{y}×{psi} | {:.2} | {scheme} | {cfl} | {steps} | {:.3} | {:.2} | {:+.2} |",
            solve.dx_m,
            solve.accuracy.mean_dx,
            solve.accuracy.max_dx,
            solve.accuracy.volume_percent
        );
        minus(row)
    };
    for exact in &cartesian.exact {
        for solve in cartesian.air3d.iter().filter(|solve| solve.nodes == exact.nodes) {
            let steps = solve.steps.to_string();
            rows.push(row(solve, &scheme(&solve.scheme), &solve.cfl.to_string(), &steps));
        }
        rows.push(row(exact, "*closed form*", "", ""));
    }
    let longer = &cartesian.converged;
    let shorter =
        cartesian.air3d.iter().find(|solve| solve.nodes[0] == 51 && solve.scheme == "weno5");
    let shorter = shorter.map_or(f64::NAN, |solve| solve.accuracy.volume_percent);
    let mut orders =
        vec![head("scheme | cfl | mean error, coarsest | finest | order, step by step", 2)];
    orders.extend(cartesian.orders.iter().map(order_row));
    let spacings = cartesian.orders.first().map_or(0, |order| order.errors.len());
    format!(
        "## Cartesian solver

*mitchell* (\"air3D\") on x ∈ [−6, 20] m, y ∈ [−10, 10] m, ψ ∈ [0, 2π), T = {} s, in single
precision. Errors of the zero level are |V| of the closed form at the places where the solution
changes sign along the grid's lines of x and y, in spacings Δx. The volume is that of the function
interpolated between the nodes, as `sidestep solve` prints it: the rows *closed form* are the exact
values on the same nodes, measured in the same way, and show the measure's own error. The closed form is the
converged value; solving for π s instead of {} s moves the volume from {} % to {} %
(WENO5, 51×40×50).

{}

![Mean error against spacing on logarithmic axes](convergence.svg)

Left: V_τ = −(∂V/∂x)²/2 from cos x, at half the time until a kink forms, where the exact solution
is known from its characteristics. Right: the table above, where V has kinks. Triangles show
slopes of the orders 1 to 3.

Observed orders of the smooth problem: log₂ of the ratio of mean errors on {spacings} grids, each
twice as fine as the one before. WENO5 is paired with a third-order Runge–Kutta method, which
sets the order here. *Not advised* are steps longer than the library's own choice: ENO is
then not stable on all of the stencils that it may choose, and this is what it costs.

{}
",
        cartesian.horizon_s,
        cartesian.horizon_s,
        minus(format!("{shorter:+.3}")),
        minus(format!("{:+.3}", longer.volume_percent)),
        rows.join("\n"),
        orders.join("\n")
    )
}

fn order_row(order: &Order) -> String {
    let errors: Vec<_> = order.errors.iter().map(|(_, error)| *error).collect();
    let orders: Vec<_> =
        errors.windows(2).map(|two| minus(format!("{:.2}", (two[0] / two[1]).log2()))).collect();
    let end = |error: Option<&f64>| error.map_or_else(String::new, |error| power(*error));
    format!(
        "| {} | {}{} | {} | {} | {} |",
        scheme(&order.scheme),
        order.cfl,
        if order.advised { "" } else { " (*not advised*)" },
        end(errors.first()),
        end(errors.last()),
        orders.join(", ")
    )
}

fn unequal(unequal: &Unequal) -> String {
    let [x, y, psi] = unequal.nodes;
    let mut rows = vec![head("compared | states | p50 | p90 | p99 | max", 1)];
    let mut row = |what: &str, errors: &Errors| {
        let figures = [errors.p50, errors.p90, errors.p99, errors.max].map(cm).join(" | ");
        rows.push(format!("| {what} | {} | {figures} |", thousands(errors.count)));
    };
    row("Cartesian and reference", &unequal.differences);
    row("polar, standard and fine", &unequal.standard_and_fine);
    format!(
        "## Unequal vehicles

No closed form is known, so solutions are compared with each other. The reference has the value
over {} s at {} random states, by an independent program on two grids, with an estimate of its
own error. The Cartesian solver (WENO5, {x}×{y}×{psi} nodes) is within that estimate at **{} of
{}** states. The polar solver's two finer grids are compared where |V| < 0.5 m. Differences in
centimetres:

{}

The converged value cannot be above that of a finite time. The fine polar solution is, at worst,
by {} cm more than the reference's estimate.
",
        unequal.horizon_s,
        thousands(unequal.states),
        thousands(unequal.within),
        thousands(unequal.states),
        rows.join("\n"),
        cm(unequal.above_finite)
    )
}

fn side_by_side(peers: &Peers) -> String {
    let mut rows = vec![head(
        "solver | grid | scheme | wall, s | mean, Δx | max, Δx | volume, % | times as fast",
        1,
    )];
    let row = |solved: &Solved, note: &str, ratio: &str| {
        format!(
            "| {}{note} | {} | {} | {} | {:.3} | {:.2} | {} | {ratio} |",
            solved.solver,
            solved.grid.replace('x', "×"),
            scheme(&solved.scheme),
            seconds(solved.wall_s),
            solved.mean_dx,
            solved.max_dx,
            minus(format!("{:+.2}", solved.volume_percent))
        )
    };
    for pair in peers.measured.chunks(2) {
        let theirs = pair.first().map_or(f64::NAN, |theirs| theirs.wall_s);
        for solved in pair {
            let ours = solved.solver == "sidestep";
            let ratio =
                if ours { format!("**{:.0}**", theirs / solved.wall_s) } else { String::new() };
            rows.push(row(solved, "", &ratio));
        }
    }
    rows.extend(peers.quoted.iter().map(|solved| row(solved, " (quoted)", "")));
    format!(
        "## Side by side with other solvers

air3D as above, the same nodes, scheme, horizon and cfl (0.75) for both, on {} cores;
**measured on {}** by `cargo xtask bench peers`; `cargo xtask validate --peers` measures it anew.
hj_reachability runs compiled and warm. Errors are measured by the same code for both, against
the closed form. Rows marked *quoted* are older figures of other programs on two shared cores, measured by
other code; take their times as a scale, not as a race.

{}
",
        peers.cores,
        peers.date,
        rows.join("\n")
    )
}

fn limits(report: &Report) -> String {
    let standard = report.polar.iter().find(|polar| polar.accuracy == "standard");
    let kink = standard.map_or_else(String::new, |polar| {
        format!(
            "{} cm at most, {} cm at the 99th percentile",
            cm(polar.random.max),
            cm(polar.random.p99)
        )
    });
    let finest = report.cartesian.exact.last().map_or([0; 3], |solve| solve.nodes);
    let at_finest =
        report.cartesian.air3d.iter().find(|s| s.nodes == finest && s.scheme == "weno5");
    let worst = at_finest.map_or(f64::NAN, |solve| solve.accuracy.max_dx);
    let chase = &report.chase;
    let (sweeps, end) = if chase.chase.0 >= chase.most_sweeps {
        (chase.chase.0, "the solver gave up there")
    } else {
        (chase.chase.0, "then it had converged")
    };
    format!(
        "## Limits

- **Kinks.** V is not smooth where two ways of evading are equally good. There every grid is of
  first order at best: the polar solver's error (*paper*, standard) is {kink};
  the Cartesian solver is off by {worst:.2} Δx at its worst place even with WENO5 on
  {}×{}×{} nodes.
- **ENO needs shorter steps** than the usual cfl of 0.75: see the rows *not advised*. The
  comparison with peers uses 0.75 all the same, because they do.
- **Long chases converge slowly.** With a pursuer {} % faster than in *paper*, the polar solver
  (standard) took {} sweeps and {end}, with a drift of {:.2} mm, instead of
  {} sweeps and {:.2} mm. Read the drift before you trust such a value.
- **A finite horizon is another question.** The Cartesian solver answers for T seconds; with
  vehicles that can chase each other longer than that, its V is above the converged one.
- These are errors of V for *this* model: constant speeds, exact states, no delay. They say
  nothing about people or robots.
",
        finest[0],
        finest[1],
        finest[2],
        chase.faster_percent,
        thousands(sweeps),
        1000.0 * chase.chase.1,
        thousands(chase.equal.0),
        1000.0 * chase.equal.1
    )
}

/// What a map shows, in a few numbers.
struct MapErrors {
    p50: f64,
    p99: f64,
    max: f64,
    /// Where the largest is.
    worst: (f64, f64),
}

impl MapErrors {
    fn of(map: &ErrorMap) -> Self {
        let mut cells = Vec::new();
        for (j, row) in map.rows.iter().enumerate() {
            for (i, error) in row.iter().enumerate() {
                let at = |origin: f64, i: usize| origin + map.cell_m * i as f64;
                cells.push((*error, (at(map.origin.0, i), at(map.origin.1, j))));
            }
        }
        cells.sort_by(|a, b| a.0.total_cmp(&b.0));
        let at = |share: f64| {
            let last = cells.len().saturating_sub(1);
            cells.get((last as f64 * share) as usize).copied().unwrap_or_default()
        };
        Self { p50: at(0.5).0, p99: at(0.99).0, max: at(1.0).0, worst: at(1.0).1 }
    }
}

fn scheme(name: &str) -> String {
    if name == "upwind" { name.to_owned() } else { name.to_uppercase() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_order_is_read_off_neighbouring_grids() {
        let order = Order {
            scheme: "eno2".into(),
            cfl: 0.75,
            advised: false,
            errors: vec![(0.2, 8e-4), (0.1, 2e-4), (0.05, 4e-4)],
        };
        let row = order_row(&order);
        assert_eq!(row, "| ENO2 | 0.75 (*not advised*) | 8.0·10⁻⁴ | 4.0·10⁻⁴ | 2.00, −1.00 |");
    }

    #[test]
    fn peers_are_compared_case_by_case() {
        let kept = include_str!("../../../../docs/validation/peers.json");
        let text = side_by_side(&Peers::parse(kept).expect("the file is committed"));
        assert_eq!(text.matches("| sidestep |").count(), 4, "{text}");
        assert_eq!(text.matches("(quoted)").count(), 2, "{text}");
        assert_eq!(text.matches("**").count(), 2 + 2 * 4, "{text}");
    }

    #[test]
    fn every_picture_is_on_a_page() {
        let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../docs/validation");
        let files = |ending: &str| -> Vec<std::path::PathBuf> {
            let entries = std::fs::read_dir(folder).expect("the folder is committed");
            let paths = entries.map(|entry| entry.expect("an entry").path());
            paths.filter(|path| path.extension().is_some_and(|found| found == ending)).collect()
        };
        let read = |page| std::fs::read_to_string(page).expect("pages are text");
        let pages: String = files("md").into_iter().map(read).collect();
        let pictures = files("svg");
        assert!(pictures.len() > 3);
        for picture in pictures {
            let name = picture.file_name().expect("a file").to_string_lossy().into_owned();
            assert!(pages.contains(&format!("]({name})")), "{name}");
        }
    }
}
