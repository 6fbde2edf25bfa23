//! Error against spacing, scheme by scheme: where V is smooth, and in air3D.

use anyhow::Result;

use super::canvas::{Axes, BLUE, GREEN, GREY, ORANGE, PURPLE, Pen, RGBColor, Scale, Side, picture};
use crate::validate::reachability::report::{Curve, Report};

/// Colours of the schemes.
const SCHEMES: [(&str, &str, RGBColor); 4] = [
    ("upwind", "upwind", ORANGE),
    ("eno2", "ENO2", GREEN),
    ("eno3", "ENO3", PURPLE),
    ("weno5", "WENO5", BLUE),
];

pub(super) fn draw(report: &Report) -> Result<String> {
    picture([930, 430], |sheet| {
        let spacings =
            [(0.005, "0.005"), (0.01, "0.01"), (0.02, "0.02"), (0.04, "0.04"), (0.08, "0.08")];
        let errors = [
            (1e-9, "10⁻⁹"),
            (1e-8, "10⁻⁸"),
            (1e-7, "10⁻⁷"),
            (1e-6, "10⁻⁶"),
            (1e-5, "10⁻⁵"),
            (1e-4, "10⁻⁴"),
            (1e-3, "10⁻³"),
            (1e-2, "10⁻²"),
        ];
        let x = Scale::logarithmic((0.0022, 0.1), &spacings, "spacing Δx, rad");
        let y = Scale::logarithmic((3e-10, 3e-2), &errors, "mean error");
        let frame = [70.0, 40.0, 360.0, 336.0];
        let axes = Axes::new(sheet, frame, "a smooth problem in one dimension", x, y)?;
        for order in report.cartesian.orders.iter().filter(|order| order.advised) {
            let (_, name, colour) = scheme(&order.scheme);
            points(&axes, &order.errors, colour)?;
            if let Some(last) = order.errors.last() {
                axes.say(*last, (-8.0, 0.0), name, colour, Side::Left)?;
            }
        }
        for (order, at) in [(1, 4e-4), (2, 2.6e-6), (3, 2.2e-9)] {
            slope(&axes, order, (0.011, at), 2.5)?;
        }

        let spacings = [(0.25, "0.25"), (0.35, "0.35"), (0.5, "0.5"), (0.7, "0.7"), (1.0, "1")];
        let errors = [(0.001, "0.1"), (0.01, "1"), (0.1, "10")];
        let x = Scale::logarithmic((0.2, 2.4), &spacings, "spacing Δx of x, m");
        let y = Scale::logarithmic((1e-4, 1.0), &errors, "mean error of {V = 0}, cm");
        let axes = Axes::new(sheet, [520.0, 40.0, 390.0, 336.0], "air3D", x, y)?;
        for (key, name, colour) in SCHEMES {
            let of = report.cartesian.air3d.iter().filter(|solve| solve.scheme == key);
            let errors: Curve =
                of.map(|solve| (solve.dx_m, solve.accuracy.mean_dx * solve.dx_m)).collect();
            points(&axes, &errors, colour)?;
            if let Some(first) = errors.first() {
                // The lines of the last two end close to each other.
                let below = match key {
                    "eno3" => -4.0,
                    "weno5" => 5.0,
                    _ => 0.0,
                };
                axes.say(*first, (9.0, below), name, colour, Side::Right)?;
            }
        }
        let exact = report.cartesian.exact.iter();
        let exact: Curve =
            exact.map(|solve| (solve.dx_m, solve.accuracy.mean_dx * solve.dx_m)).collect();
        axes.line(&exact, Pen::dashed(GREY, 1.5))?;
        if let Some(first) = exact.first() {
            axes.say(*first, (9.0, -7.0), "closed form", GREY, Side::Right)?;
            axes.say(*first, (9.0, 7.0), "on the nodes", GREY, Side::Right)?;
        }
        slope(&axes, 1, (0.5, 0.075), 1.5)?;
        slope(&axes, 2, (0.5, 0.0031), 1.5)
    })
}

fn scheme(name: &str) -> (&'static str, &'static str, RGBColor) {
    SCHEMES.into_iter().find(|scheme| scheme.0 == name).unwrap_or(SCHEMES[0])
}

fn points(axes: &Axes<'_, '_>, errors: &[(f64, f64)], colour: RGBColor) -> Result<()> {
    axes.line(errors, Pen::new(colour, 1.8))?;
    errors.iter().try_for_each(|point| axes.dot(*point, colour))
}

/// How steep an order is: a triangle from a point to `times` its spacing.
fn slope(axes: &Axes<'_, '_>, order: i32, (x, y): (f64, f64), times: f64) -> Result<()> {
    let (far, up) = (x * times, y * times.powi(order));
    axes.line(&[(x, y), (far, y), (far, up), (x, y)], Pen::new(GREY, 1.0))?;
    let words = order.to_string();
    axes.say((far, (y * up).sqrt()), (5.0, 0.0), &words, GREY, Side::Right)
}
