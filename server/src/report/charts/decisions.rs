//! Maps of the situations in which models turn.

use super::{Figure, TONES, WIDTH, drawn, opacity};
use sidestep::chart::{Area, Axis, Cells, Chart, Drawing, Ink, Note, Pen, Sign, colours, disc};
use sidestep::comparison::Analysis;
use sidestep::comparison::decision_map::DecisionMap;
use sidestep::math::PI;

/// Maps of the probability of a turn; `None` if there are no maps.
pub(super) fn decisions(analysis: &Analysis) -> Option<Figure> {
    let maps = analysis.maps.iter().filter(|map| !map.probabilities.is_empty());
    let charts: Vec<Chart> =
        maps.map(|map| decision_map(map, analysis.data.scene.danger_radius_m)).collect();
    (!charts.is_empty()).then(|| Figure { has_tones: true, ..drawn("decisions", &charts, square) })
}

/// A chart with the same scale on both axes.
fn square(chart: &Chart) -> Drawing {
    let side = chart.frame_within([WIDTH, WIDTH]).width;
    let [above, below] = chart.room();
    chart.drawing([WIDTH, above + side + below])
}

fn decision_map(map: &DecisionMap, radius_m: f64) -> Chart {
    let side_m = DecisionMap::SIDE as f64 * DecisionMap::CELL_M;
    // The map uses distances to the left. The chart uses distances to the right, so the sign changes.
    let right = -(DecisionMap::RIGHT_M + side_m);
    let x = Axis::linear("robot to the right", "m", [right, right + side_m], 6);
    let behind = DecisionMap::BEHIND_M;
    let y = Axis::linear("robot ahead", "m", [behind, behind + side_m], 6);
    let heading = format!("{}: robot {}", map.features, map.encounter);
    let mut chart = Chart::new(&heading, &described(map), x, y);
    for (tone, boxes) in tones(map).into_iter().enumerate() {
        chart.add(Cells { ink: colours::MAP.at(opacity(tone)), boxes });
    }
    let mut outline = |name: &str, points, edge| {
        let (name, fill) = (name.to_owned(), None::<Ink>);
        chart.add(Area { name, points, fill, edge: Some(edge) });
    };
    for curve in &map.boundary {
        let points = curve.iter().map(|[ahead, left]| [-left, *ahead]).collect();
        let edge = Pen::new(colours::TEXT, 2.0).halo(1.5);
        outline("V_HR = 0: inside, the robot could force a collision", points, edge);
    }
    let dashed = Pen::new(colours::TEXT, 1.2).dashed(3.0, 2.5);
    outline("danger zone", disc([0.0, 0.0], radius_m), dashed);
    chart.add(Note::sign(Sign::Vehicle(0.5 * PI, 17.0), [0.0, 0.0], colours::HUMAN));
    // The robot's heading relative to the human, whose heading is up in the chart.
    let arrow = Sign::Arrow(map.heading + 0.5 * PI, 28.0);
    let corner = Note::sign(arrow, [right + side_m, behind + side_m], colours::ROBOT);
    chart.add(Note { offset: [-24.0, 24.0], ..corner });
    chart
}

/// The cells of each tone. Adjacent cells in a row are merged.
fn tones(map: &DecisionMap) -> Vec<Vec<[f64; 4]>> {
    let tone = |p: f64| ((p * TONES as f64) as usize).min(TONES - 1);
    let mut boxes = vec![Vec::new(); TONES];
    for (row, cells) in map.probabilities.chunks(DecisionMap::SIDE).enumerate() {
        let at = |begin: f64, i: usize| begin + DecisionMap::CELL_M * i as f64;
        let (below, above) = (at(DecisionMap::BEHIND_M, row), at(DecisionMap::BEHIND_M, row + 1));
        let mut column = 0;
        while column < cells.len() {
            let of = tone(cells[column]);
            let run = cells[column..].iter().take_while(|p| tone(**p) == of).count();
            // Columns are ordered from right to left.
            let ends = [column, column + run].map(|i| -at(DecisionMap::RIGHT_M, i));
            boxes[of].push([ends[1], below, ends[0], above]);
            column += run;
        }
    }
    boxes
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
