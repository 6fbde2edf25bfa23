//! What the models decide, wherever the robot is.

use super::super::chart::{Axis, Chart, Margins, WIDTH, figure, legend, px};
use super::super::words;
use sidestep::comparison::Analysis;
use sidestep::comparison::decision_map::{DecisionMap, MAPPED_MODEL};
use sidestep::math::{PI, TAU, sin_cos};

/// Tones of the map.
const TONES: usize = 10;

const MARGINS: [f64; 4] = [46.0, 26.0, 12.0, 40.0];

/// Maps of the probability of a turn.
pub(in super::super) fn figure_of(analysis: &Analysis) -> String {
    let maps = analysis.maps.iter().filter(|map| !map.probabilities.is_empty());
    let charts: Vec<String> =
        maps.map(|map| chart(map, analysis.data.scene.danger_radius_m)).collect();
    if charts.is_empty() {
        return String::new();
    }
    let tones: String = (0..TONES)
        .map(|tone| {
            format!("<span style=\"--tone:{}%\"></span>", 100 * (2 * tone + 1) / (2 * TONES))
        })
        .collect();
    let scale = format!(
        "<p class=\"scale\"><span>turn: 0 %</span><span class=\"tones\" aria-hidden=\"true\">{tones}\
         </span><span>100 %</span></p>\n"
    );
    let signs = legend(&[
        (
            "<line class=\"barrier\" x1=\"0\" y1=\"6\" x2=\"26\" y2=\"6\"/>",
            "<i>V</i><sub>HR</sub> = 0: inside, the robot could force a collision",
        ),
        ("<circle class=\"danger\" cx=\"13\" cy=\"6\" r=\"5\"/>", "danger zone"),
        ("<polygon class=\"human\" points=\"13,0 17.5,11 13,9 8.5,11\"/>", "human"),
        (
            "<polyline class=\"robot\" points=\"3,6 21,6\"/><polygon class=\"robot\" points=\"25,6 18,2.5 18,9.5\"/>",
            "robot’s heading",
        ),
    ]);
    let caption = format!(
        "<b>Where people’s models turn.</b> The probability of a turn that {} (experiment II) gives \
         for a robot at each place around the human, who heads up; mean over people and over eight \
         headings in the world, as the paper’s features depend on these. Above on {}, which knows \
         both safety levels; below on {}, which cannot tell ahead from behind. Far from where \
         people drove, the models guess.",
        words::model_in_full(MAPPED_MODEL),
        words::set("hrd"),
        words::set("d")
    );
    figure(&charts, &format!("{scale}{signs}"), &caption)
        .replace("class=\"charts\"", "class=\"charts two\"")
}

fn chart(map: &DecisionMap, radius_m: f64) -> String {
    let side_m = DecisionMap::SIDE as f64 * DecisionMap::CELL_M;
    let side = WIDTH - MARGINS[0] - MARGINS[2];
    let height = side + MARGINS[1] + MARGINS[3];
    let ticks = |from: f64| -> Vec<f64> {
        (-40..40)
            .map(|i| 4.0 * f64::from(i))
            .filter(|t| (from..=from + side_m).contains(t))
            .collect()
    };
    // To the right is what is less to the left.
    let right = -(DecisionMap::RIGHT_M + side_m);
    let x = Axis::exact(right, right + side_m, ticks(right), "robot to the right (m)");
    let behind = DecisionMap::BEHIND_M;
    let y = Axis::exact(behind, behind + side_m, ticks(behind), "robot ahead (m)");
    let heading = format!("{}: robot {}", map.features, map.encounter);
    let mut chart = Chart::new(&heading, &described(map), height, Margins(MARGINS), (x, y));
    let edges = chart.edges();
    tones(&mut chart, map);
    let place = |chart: &Chart, [ahead, left]: [f64; 2]| chart.at([-left, ahead]);
    for curve in &map.boundary {
        let points: Vec<_> = curve.iter().map(|point| place(&chart, *point)).collect();
        chart.polygon("halo", &points);
        chart.polygon("barrier", &points);
    }
    let zone = (0..48).map(|i| {
        let (sin, cos) = sin_cos(f64::from(i) * TAU / 48.0);
        place(&chart, [radius_m * cos, radius_m * sin])
    });
    let zone: Vec<_> = zone.collect();
    chart.polygon("danger", &zone);
    let [x, y] = place(&chart, [0.0, 0.0]);
    chart.polygon("human", &[[x, y - 11.0], [x + 7.0, y + 8.0], [x, y + 4.0], [x - 7.0, y + 8.0]]);
    arrow(&mut chart, [edges[2] - 24.0, edges[1] + 24.0], map.heading);
    chart.finished()
}

/// Cells of one tone as one path, neighbours in a row as one piece; counted in cells, so that no
/// seam shows.
fn tones(chart: &mut Chart, map: &DecisionMap) {
    let tone = |p: f64| ((p * TONES as f64) as usize).min(TONES - 1);
    let mut paths = vec![String::new(); TONES];
    for (row, cells) in map.probabilities.chunks(DecisionMap::SIDE).enumerate() {
        let mut column = 0;
        while column < cells.len() {
            let of = tone(cells[column]);
            let run = cells[column..].iter().take_while(|p| tone(**p) == of).count();
            // Columns go to the left, and rows up.
            let (x, y) = (DecisionMap::SIDE - column - run, DecisionMap::SIDE - 1 - row);
            paths[of].push_str(&format!("M{x} {y}h{run}v1h-{run}z"));
            column += run;
        }
    }
    let [left, top, right, _] = chart.edges();
    let scale = (right - left) / DecisionMap::SIDE as f64;
    chart.raw(&format!("<g transform=\"translate({} {}) scale({scale})\">", px(left), px(top)));
    for (tone, path) in paths.iter().enumerate().filter(|(_, path)| !path.is_empty()) {
        let opacity = (2 * tone + 1) as f64 / (2 * TONES) as f64;
        chart.raw(&format!("<path class=\"tone\" fill-opacity=\"{opacity}\" d=\"{path}\"/>"));
    }
    chart.raw("</g>");
}

/// The robot's heading, as the human who heads up sees it.
fn arrow(chart: &mut Chart, [x, y]: [f64; 2], heading: f64) {
    let (sin, cos) = sin_cos(heading + 0.5 * PI);
    let at =
        |along: f64, aside: f64| [x + along * cos - aside * sin, y - along * sin - aside * cos];
    chart.segment("robot", at(-14.0, 0.0), at(6.0, 0.0));
    chart.polygon("robot", &[at(15.0, 0.0), at(4.0, 5.5), at(4.0, -5.5)]);
}

fn described(map: &DecisionMap) -> String {
    let at = |ahead: f64, left: f64| {
        let place = |x: f64, begin: f64| ((x - begin) / DecisionMap::CELL_M) as usize;
        let cell = place(ahead, DecisionMap::BEHIND_M) * DecisionMap::SIDE
            + place(left, DecisionMap::RIGHT_M);
        100.0 * map.probabilities.get(cell).copied().unwrap_or(0.0)
    };
    format!(
        "Probability of a turn with the robot 6 m ahead: {:.0} %; 6 m behind: {:.0} %; 6 m to the \
         left: {:.0} %; 6 m to the right: {:.0} %.",
        at(6.0, 0.0),
        at(-6.0, 0.0),
        at(0.0, 6.0),
        at(0.0, -6.0)
    )
}
