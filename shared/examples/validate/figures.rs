//! The figures of the page, as SVG on a white background, which is legible on light and dark pages.

use sidestep::chart::{
    Align, Area, Axis, Cells, Chart, Colour, Drawing, Frame, Ink, Mark, Note, Pen, Point, Series,
    Sign, colours, number,
};

use crate::cartesian;
use crate::pictures::{ErrorMap, Slice};
use crate::polar;

const BLUE: Colour = colours::SERIES[0];
const ORANGE: Colour = colours::SERIES[1];
const GREEN: Colour = colours::SERIES[2];
const PURPLE: Colour = colours::SERIES[3];

/// {V = 0} in the evader's frame: the whole curves, and an enlargement around the tip.
pub(crate) fn sliced(slices: &[Slice]) -> Drawing {
    // The first curve is drawn below the others, and is wide enough to show on both sides of them.
    let curves = [
        ("closed form", Pen::new(Colour::rgb([176, 196, 214]), 5.0)),
        ("Cartesian solver, WENO5, 51×40×50", Pen::new(BLUE, 1.5)),
        ("polar solver, standard", Pen::new(ORANGE, 1.5).dashed(5.0, 4.0)),
    ];
    let mut drawing = Drawing::new("V = 0 by three methods", "", [960.0, 590.0]);
    for (i, slice) in slices.iter().enumerate() {
        let add = |chart: &mut Chart| {
            let sets = [&slice.exact, &slice.cartesian, &slice.polar];
            for ((name, pen), set) in curves.iter().zip(sets) {
                for points in set {
                    let (name, points, fill) = ((*name).to_owned(), points.clone(), None);
                    chart.add(Area { name, points, fill, edge: Some(*pen) });
                }
            }
        };
        let title = format!("ψ = {}°", number(slice.psi_deg));
        let x = Axis::linear("x ahead", "m", [-6.0, 20.0], 6);
        let y = Axis::linear("y to the left", "m", [-10.0, 10.0], 4);
        let mut whole = Chart::new(&title, "", x, y);
        add(&mut whole);
        whole.add(Note::sign(Sign::Vehicle(0.0, 14.0), [0.0, 0.0], colours::TEXT));
        // The enlargement shows 2.6 m × 2 m around the tip, and the whole picture 26 m × 20 m.
        let [tip_x, tip_y] = slice.tip.map(|at| (at * 10.0).round() / 10.0);
        let (wide, high) = ([tip_x - 1.9, tip_x + 0.7], [tip_y - 1.0, tip_y + 1.0]);
        let points =
            vec![[wide[0], high[0]], [wide[1], high[0]], [wide[1], high[1]], [wide[0], high[1]]];
        let edge = Some(Pen::new(colours::MUTED, 1.0));
        whole.add(Area { name: String::new(), points, fill: None, edge });
        let x = Axis::linear("x ahead", "m", wide, 6);
        let y = Axis::linear("y to the left", "m", high, 4);
        let mut enlarged = Chart::new(&format!("{title}, enlarged"), "", x, y);
        add(&mut enlarged);

        let left = 44.0 + 312.0 * i as f64;
        whole.draw(&mut drawing, Frame { left, top: 84.0, width: 260.0, height: 200.0 });
        enlarged.draw(&mut drawing, Frame { left, top: 384.0, width: 260.0, height: 162.5 });
        if i == 0 {
            drawing.legend(&whole.legend(), [44.0, 20.0], 900.0);
        }
    }
    drawing
}

/// The share of states whose error exceeds a threshold, as a function of the threshold.
pub(crate) fn exceedance(checks: &[polar::Check]) -> Drawing {
    let errors = [(1e-4, "0.1 mm"), (1e-3, "1 mm"), (1e-2, "1 cm"), (1e-1, "10 cm"), (1.0, "1 m")];
    let labels = errors.map(|(at, label)| (at, label.to_owned())).into();
    let name = "error |V(polar) − V(closed form)|";
    let x = Axis { labels, ..Axis::logarithmic(name, "", [1e-4, 1.0]) };
    let y = Axis::logarithmic("states with a larger error", "%", [1e-2, 100.0]);
    let mut chart = Chart::new("", "", x, y);
    for (accuracy, colour) in [("draft", ORANGE), ("standard", BLUE), ("fine", GREEN)] {
        for check in checks.iter().filter(|check| check.accuracy == accuracy) {
            let pen = Pen::new(colour, 2.0);
            let pen = if check.game == "paper" { pen } else { pen.dashed(5.0, 4.0) };
            let points = check.exceedance.iter().map(|(error, share)| [*error, 100.0 * share]);
            chart.add(Series::drawn(&format!("{}, {accuracy}", check.game), points, pen));
        }
    }
    let mut drawing = Drawing::new("Errors of the polar solver", "", [860.0, 400.0]);
    chart.draw(&mut drawing, Frame { left: 56.0, top: 34.0, width: 610.0, height: 318.0 });
    drawing.legend(&chart.legend(), [690.0, 50.0], 60.0);
    drawing
}

/// Lower bound of each error level (m), and the colour of the level.
const LEVELS: [(f64, [u8; 3]); 7] = [
    (0.0, [247, 246, 242]),
    (0.001, [253, 226, 182]),
    (0.002, [253, 187, 120]),
    (0.005, [239, 118, 84]),
    (0.01, [203, 60, 88]),
    (0.02, [130, 30, 110]),
    (0.05, [45, 10, 70]),
];

/// A map of the errors, with a colour bar.
pub(crate) fn error_map(map: &ErrorMap) -> Drawing {
    let x = Axis::linear("x ahead", "m", [-6.0, 15.0], 12);
    let y = Axis::linear("y to the left", "m", [-8.0, 8.0], 8);
    let mut chart = Chart::new("", "", x, y);
    // Each level is drawn over the previous one, so that no white gaps show between neighbours.
    for (level, colour) in LEVELS {
        let corner = |origin: f64, i: usize| origin + map.cell_m * (i as f64 - 0.5);
        let cell = |[row, from, to]: [usize; 3]| {
            let ([x, y], at) = (map.origin, corner);
            [at(x, from), at(y, row), at(x, to), at(y, row + 1)]
        };
        let boxes = runs(&map.rows, level).into_iter().map(cell).collect();
        chart.add(Cells { ink: Colour::rgb(colour).into(), boxes });
    }
    for curve in &map.zero {
        let edge = Some(Pen::new(colours::TEXT, 1.3));
        chart.add(Area { name: String::new(), points: curve.clone(), fill: None, edge });
    }
    let at = [13.1, 0.0];
    chart.add(Note::words("V = 0", at, [8.0, -12.0], colours::TEXT, Align::Left));
    chart.add(Note::sign(Sign::Vehicle(0.0, 14.0), [0.0, 0.0], colours::TEXT));
    let mut drawing = Drawing::new("Errors at ψ = 180°", "", [930.0, 636.0]);
    chart.draw(&mut drawing, Frame { left: 50.0, top: 34.0, width: 735.0, height: 560.0 });

    let count = LEVELS.len() as f64;
    let labels = LEVELS.iter().enumerate().map(|(i, (m, _))| (i as f64, number(100.0 * m)));
    let y = Axis::ticked("|error|", "cm", [0.0, count], labels.collect());
    let mut bar = Chart::new("", "", Axis::ticked("", "", [0.0, 1.0], Vec::new()), y);
    for (i, (_, colour)) in LEVELS.into_iter().enumerate() {
        let boxes = vec![[0.0, i as f64, 1.0, i as f64 + 1.0]];
        bar.add(Cells { ink: Colour::rgb(colour).into(), boxes });
    }
    bar.draw(&mut drawing, Frame { left: 850.0, top: 74.0, width: 22.0, height: 480.0 });
    drawing
}

/// The row, the first column and the end column (exclusive) of each run of errors of at least
/// `level`.
fn runs(rows: &[Vec<f64>], level: f64) -> Vec<[usize; 3]> {
    let mut runs = Vec::new();
    for (j, row) in rows.iter().enumerate() {
        let mut column = 0;
        for stretch in row.chunk_by(|a, b| (*a >= level) == (*b >= level)) {
            if stretch[0] >= level {
                runs.push([j, column, column + stretch.len()]);
            }
            column += stretch.len();
        }
    }
    runs
}

/// Error against spacing for each scheme, in a smooth problem and in air3D.
pub(crate) fn convergence(check: &cartesian::Check) -> Drawing {
    const SCHEMES: [(&str, Colour, Mark); 4] = [
        ("upwind", ORANGE, Mark::Square),
        ("ENO2", GREEN, Mark::Triangle),
        ("ENO3", PURPLE, Mark::Diamond),
        ("WENO5", BLUE, Mark::Circle),
    ];
    let mut drawing = Drawing::new("Error against spacing", "", [960.0, 440.0]);
    let x = Axis::logarithmic("spacing Δx", "rad", [0.0022, 0.1]);
    let y = Axis::logarithmic("mean error", "", [3e-10, 3e-2]);
    let mut smooth = Chart::new("A smooth problem in one dimension", "", x, y);
    let x = Axis::logarithmic("spacing Δx of x", "m", [0.2, 2.4]);
    let y = Axis::logarithmic("mean error of {V = 0}", "cm", [1e-2, 100.0]);
    let mut air3d = Chart::new("air3D", "", x, y);
    let centimetres = |scheme: &str| -> Vec<Point> {
        let solves = check.air3d.iter().filter(|of| of.scheme == scheme);
        solves.map(|of| [of.dx_m, 100.0 * of.accuracy.mean_dx * of.dx_m]).collect()
    };
    for (name, colour, mark) in SCHEMES {
        let mut orders = check.orders.iter().filter(|of| of.advised && of.scheme == name);
        let points: Vec<Point> = orders.next().map_or_else(Vec::new, |order| {
            order.errors.iter().map(|(spacing, error)| [*spacing, *error]).collect()
        });
        if let Some(last) = points.last() {
            smooth.add(Note::words(name, *last, [-8.0, 0.0], colour, Align::Right));
        }
        smooth.add(Series::line(name, points, colour, 1.8).marked(mark));
        let points = centimetres(name);
        if let Some(first) = points.first() {
            // Two lines end close to each other, so their labels are moved apart.
            let below = match name {
                "ENO3" => -5.0,
                "WENO5" => 6.0,
                _ => 0.0,
            };
            air3d.add(Note::words(name, *first, [9.0, below], colour, Align::Left));
        }
        air3d.add(Series::line(name, points, colour, 1.8).marked(mark));
    }
    for (order, at) in [(1, 4e-4), (2, 2.6e-6), (3, 2.2e-9)] {
        add_slope(&mut smooth, order, [0.011, at], 2.5);
    }
    let exact = centimetres(cartesian::EXACT);
    if let Some(first) = exact.first() {
        for (text, below) in [("closed form", -7.0), ("on the nodes", 7.0)] {
            air3d.add(Note::words(text, *first, [9.0, below], colours::MUTED, Align::Left));
        }
    }
    air3d.add(Series::drawn("", exact, Pen::new(colours::MUTED, 1.5).dashed(5.0, 4.0)));
    add_slope(&mut air3d, 1, [0.5, 7.5], 1.5);
    add_slope(&mut air3d, 2, [0.5, 0.31], 1.5);
    smooth.draw(&mut drawing, Frame { left: 60.0, top: 54.0, width: 370.0, height: 336.0 });
    air3d.draw(&mut drawing, Frame { left: 530.0, top: 54.0, width: 400.0, height: 336.0 });
    drawing
}

/// A triangle that shows the slope of an order, from the spacing `x` to the spacing `times * x`.
fn add_slope(chart: &mut Chart, order: i32, [x, y]: Point, times: f64) {
    let (far, up) = (x * times, (0..order).fold(y, |up, _| up * times));
    let points = vec![[x, y], [far, y], [far, up]];
    let (fill, edge) = (None::<Ink>, Some(Pen::new(colours::MUTED, 1.0)));
    chart.add(Area { name: String::new(), points, fill, edge });
    let at = [far, (y * up).sqrt()];
    chart.add(Note::words(&order.to_string(), at, [5.0, 0.0], colours::MUTED, Align::Left));
}
