//! The scenes of a study: how evenly they are distributed, and some of them seen from above.

use super::{MARGIN, headed};
use sidestep::chart::{
    Align, Area, Axis, Cells, Chart, Drawing, Frame, LegendItem, Mark, Note, Pen, Point, Series,
    Sign, colours, disc, fixed, number, round_step,
};
use sidestep::scene::{
    Coordinate, Encounter, JointState, SceneParameters, Stratification, StratifiedScene,
};
use sidestep::vehicle::TurnInput;

/// Width between the margins (px).
const WIDTH: f64 = 1224.0;
/// Space to the left of a chart for its labels (px).
const LABELS: f64 = 44.0;
/// Number of charts side by side, and the gap between two of them (px).
const COLUMNS: usize = 3;
const BETWEEN: f64 = 26.0;
/// Heights of the charts (px).
const COUNTS: f64 = 96.0;
const MAP: f64 = 280.0;
/// Scenes from above: number side by side, maximum number, and gap between two scenes (px).
const ABREAST: usize = 6;
const SCENES: usize = 12;
const GAP: f64 = 16.0;

/// Draws the distribution of a phase's scenes, and the first participant's first scenes. `people`
/// has the scenes of each participant; the index is the participant's place. `notes` name the study
/// and the phase.
#[must_use]
pub fn design(
    notes: &[String],
    parameters: &SceneParameters,
    strata: &Stratification,
    people: &[Vec<StratifiedScene>],
) -> Drawing {
    let notes: Vec<&str> = notes.iter().map(String::as_str).collect();
    let mut drawing = headed("How the scenes are spread", &notes, WIDTH);
    drawing.description = format!(
        "{} scenes for each of {} participants over approach angle, miss distance and entry time.",
        strata.count(),
        people.len()
    );
    let first: &[StratifiedScene] = people.first().map_or(&[], Vec::as_slice);
    let mut top = drawing.size[1] + 10.0;

    for (i, coordinate) in Coordinate::ALL.into_iter().enumerate() {
        let chart = counts(coordinate, strata, people);
        chart.draw(&mut drawing, frame(i, top + chart.room()[0], COUNTS));
        if i + 1 == COLUMNS {
            top += chart.room().iter().sum::<f64>() + COUNTS + 22.0;
        }
    }
    let pairs = [
        [Coordinate::Approach, Coordinate::Miss],
        [Coordinate::Approach, Coordinate::Entry],
        [Coordinate::Miss, Coordinate::Entry],
    ];
    let [above, below] =
        Chart::new("", "", axis(pairs[0][0], strata), axis(pairs[0][1], strata)).room();
    for (i, pair) in pairs.into_iter().enumerate() {
        let frame = frame(i, top + above, MAP);
        map(pair, strata, people, first, frame).draw(&mut drawing, frame);
    }
    top += above + MAP + below + 16.0;
    let items = [
        LegendItem::line("a scene of any participant", None, Some((Mark::Square, dots(people)))),
        LegendItem::line(
            "a scene of the first participant",
            None,
            Some((Mark::Circle, colours::ACCENT.into())),
        ),
    ];
    top += drawing.legend(&items, [MARGIN + LABELS, top], WIDTH) + 34.0;
    top = scenes(&mut drawing, parameters, first, top);
    drawing.size[1] = top + 8.0;
    drawing
}

/// The frame of a chart in a row of three.
fn frame(column: usize, top: f64, height: f64) -> Frame {
    let cell = (WIDTH + BETWEEN) / COLUMNS as f64;
    let left = MARGIN + column as f64 * cell + LABELS;
    Frame { left, top, width: cell - BETWEEN - LABELS, height }
}

/// The axis of a coordinate.
fn axis(coordinate: Coordinate, strata: &Stratification) -> Axis {
    let last = strata.count().saturating_sub(1);
    let ends = [strata.ends(coordinate, 0)[0], strata.ends(coordinate, last)[1]];
    match coordinate {
        Coordinate::Approach => {
            let ticks = [-180, -120, -60, 0, 60, 120, 180];
            let label = |degrees: i32| (f64::from(degrees), fixed(f64::from(degrees), 0));
            let labels = ticks.map(label).to_vec();
            Axis::ticked(
                "approach angle: human’s heading less robot’s",
                "°",
                [-180.0, 180.0],
                labels,
            )
        }
        Coordinate::Miss => Axis::linear("miss distance if nobody turns", "m", ends, 8),
        Coordinate::Entry => Axis::linear("entry time if nobody turns", "s", ends, 8),
    }
}

/// The value of a coordinate in an encounter, in the unit of the coordinate's axis.
fn on_axis(coordinate: Coordinate, encounter: &Encounter) -> f64 {
    match coordinate {
        Coordinate::Approach => encounter.approach_rad.to_degrees(),
        Coordinate::Miss => encounter.miss_m,
        Coordinate::Entry => encounter.entry_s,
    }
}

/// A chart of the number of scenes in each stratum, with the planned number as a line.
fn counts(
    coordinate: Coordinate,
    strata: &Stratification,
    people: &[Vec<StratifiedScene>],
) -> Chart {
    let mut times = vec![0_usize; strata.count()];
    for scene in people.iter().flatten() {
        times[scene.strata[coordinate as usize]] += 1;
    }
    let most = times.iter().copied().max().unwrap_or(0).max(people.len()) as f64;
    let x = axis(coordinate, strata);
    let ends = x.ends;
    let y = Axis::linear("scenes in each stratum", "", [0.0, 1.15 * most], 4);
    let mut chart = Chart::new("", "", x, y);
    let boxes = times.iter().enumerate().map(|(stratum, times)| {
        let [low, high] = strata.ends(coordinate, stratum);
        let [low, high] = match coordinate {
            Coordinate::Approach => [low.to_degrees(), high.to_degrees()],
            _ => [low, high],
        };
        // Separates neighbouring bars by a thin gap.
        let seam = 0.06 * (high - low);
        [low + seam, 0.0, high - seam, *times as f64]
    });
    chart.add(Cells { ink: colours::ACCENT.at(0.55), boxes: boxes.collect() });
    let planned = [[ends[0], people.len() as f64], [ends[1], people.len() as f64]];
    chart.add(Series::drawn("", planned, Pen::new(colours::TEXT, 1.0).dashed(4.0, 3.0)));
    chart
}

/// Ink of a dot. The ink is fainter if there are more dots.
fn dots(people: &[Vec<StratifiedScene>]) -> colours::Ink {
    let many = people.iter().map(Vec::len).sum::<usize>().max(1) as f64;
    colours::TEXT.at((900.0 / many).clamp(0.06, 0.45))
}

/// A chart with every scene as a dot. The first participant's scenes are highlighted.
fn map(
    [x, y]: [Coordinate; 2],
    strata: &Stratification,
    people: &[Vec<StratifiedScene>],
    first: &[StratifiedScene],
    frame: Frame,
) -> Chart {
    const HALF: f64 = 1.2;
    let mut chart = Chart::new("", "", axis(x, strata), axis(y, strata));
    let at = |scene: &StratifiedScene| [on_axis(x, &scene.encounter), on_axis(y, &scene.encounter)];
    let half = [
        HALF * (chart.x.ends[1] - chart.x.ends[0]) / frame.width,
        HALF * (chart.y.ends[1] - chart.y.ends[0]) / frame.height,
    ];
    let boxes = people.iter().flatten().map(at);
    let boxes = boxes.map(|[x, y]| [x - half[0], y - half[1], x + half[0], y + half[1]]);
    chart.add(Cells { ink: dots(people), boxes: boxes.collect() });
    let points = first.iter().map(at);
    chart.add(Series::line("", points, colours::ACCENT, 1.0).marked(Mark::Circle).without_line());
    chart
}

/// Draws scenes from above, all at the same scale. Returns the bottom of the last row (px).
fn scenes(
    drawing: &mut Drawing,
    parameters: &SceneParameters,
    first: &[StratifiedScene],
    top: f64,
) -> f64 {
    let shown = &first[..first.len().min(SCENES)];
    let many = match shown.len() {
        1 => "The first scene".to_owned(),
        many => format!("The first {many} scenes"),
    };
    let heading = format!(
        "{many} of the first participant, from above: approach angle, miss distance, entry time"
    );
    drawing.bold(&heading, [MARGIN, top], 14.0, colours::TEXT, Align::Left);
    let items = [
        LegendItem::sign("human at the start", &Sign::Vehicle(0.0, 17.0), colours::HUMAN),
        LegendItem::sign("robot at the start", &Sign::Vehicle(0.0, 17.0), colours::ROBOT),
        LegendItem::line("robot’s goal", None, Some((Mark::Square, colours::ROBOT.into()))),
        LegendItem::disc(
            "danger zone when the human would enter it",
            Some(colours::ROBOT.at(0.12)),
            Pen::new(colours::ROBOT, 1.0),
        ),
        LegendItem::line(
            "path if nobody turns",
            Some(Pen::new(colours::HUMAN, 1.4).dashed(4.0, 3.0)),
            None,
        ),
    ];
    let top = top + 22.0;
    let top = top + drawing.legend(&items, [MARGIN, top], WIDTH) + 40.0;
    let side = (WIDTH - (ABREAST - 1) as f64 * GAP) / ABREAST as f64;
    let reach = reach_m(parameters, shown);
    for (i, scene) in shown.iter().enumerate() {
        let left = MARGIN + (i % ABREAST) as f64 * (side + GAP);
        let top = top + (i / ABREAST) as f64 * (side + 48.0);
        let frame = Frame { left, top, width: side, height: side };
        one(drawing, parameters, scene, reach, frame, i);
    }
    top + shown.len().div_ceil(ABREAST) as f64 * (side + 48.0) - 20.0
}

/// Half the side of a square, centred on the origin, that contains all paths of these scenes with a
/// margin (m).
fn reach_m(parameters: &SceneParameters, shown: &[StratifiedScene]) -> f64 {
    let ends = shown.iter().flat_map(|scene| {
        let start = scene.scene.start();
        let end = start.advance(parameters, TurnInput::Straight, 0.0, parameters.duration_s());
        [start.human, start.robot, end.human, end.robot].map(|pose| pose.position())
    });
    1.12 * ends.flatten().map(f64::abs).fold(1.0, f64::max)
}

/// Draws one scene from above, with a scale bar, and with the values of its coordinates as text
/// above it.
fn one(
    drawing: &mut Drawing,
    parameters: &SceneParameters,
    StratifiedScene { scene, encounter, .. }: &StratifiedScene,
    reach: f64,
    frame: Frame,
    index: usize,
) {
    let axis = || Axis::ticked("", "", [-reach, reach], Vec::new());
    let mut chart = Chart::new("", "", axis(), axis());
    let start = scene.start();
    let at = |seconds: f64| start.advance(parameters, TurnInput::Straight, 0.0, seconds);
    let JointState { human, robot } = at(parameters.duration_s());
    let path = |from: Point, to: Point, colour: colours::Colour| {
        Series::drawn("", [from, to], Pen::new(colour.at(0.8), 1.2).dashed(4.0, 3.0))
    };
    let entry = at(encounter.entry_s);
    chart.add(Area {
        name: String::new(),
        points: disc(entry.robot.position(), parameters.danger_radius_m),
        fill: Some(colours::ROBOT.at(0.12)),
        edge: Some(Pen::new(colours::ROBOT.at(0.6), 1.0)),
    });
    chart.add(path(start.human.position(), human.position(), colours::HUMAN));
    chart.add(path(start.robot.position(), robot.position(), colours::ROBOT));
    let dot = |at: Point, colour: colours::Colour, mark| {
        Series::line("", [at], colour, 1.0).marked(mark).without_line()
    };
    chart.add(dot(entry.human.position(), colours::HUMAN, Mark::Circle));
    chart.add(dot(scene.goal, colours::ROBOT, Mark::Square));
    for (pose, colour) in [(start.human, colours::HUMAN), (start.robot, colours::ROBOT)] {
        chart.add(Note::sign(Sign::Vehicle(pose.psi, 17.0), pose.position(), colour));
    }
    let rule = round_step(2.0 * reach, 5);
    let [left, low] = [-0.94 * reach, -0.92 * reach];
    chart.add(Series::line("", [[left, low], [left + rule, low]], colours::MUTED, 1.6));
    let words = format!("{} m", number(rule));
    chart.add(Note::words(&words, [left, low], [0.0, -9.0], colours::MUTED, Align::Left));
    chart.draw(drawing, frame);
    let words = format!(
        "{}:  {}°,  {} m,  {} s",
        index + 1,
        fixed(encounter.approach_rad.to_degrees(), 0),
        fixed(encounter.miss_m, 1),
        fixed(encounter.entry_s, 1),
    );
    drawing.text(&words, [frame.left, frame.top - 12.0], 11.5, colours::TEXT, Align::Left);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::figure::png;
    use sidestep::scene::{EncounterRange, counterbalanced};

    fn drawn(scenes: usize, participants: u64) -> Drawing {
        let (parameters, range) = (SceneParameters::default(), EncounterRange::default());
        let strata = Stratification::new(&parameters, &range, scenes).unwrap();
        let people: Vec<_> = (0..participants)
            .map(|place| counterbalanced(&parameters, &range, scenes, 1, place).unwrap())
            .collect();
        design(&["made-up study".to_owned()], &parameters, &strata, &people)
    }

    #[test]
    fn every_number_has_a_unit_and_the_first_scenes_are_shown() {
        for (scenes, participants, title) in [
            (1, 1, "The first scene of"),
            (3, 6, "The first 3 scenes of"),
            (20, 20, "The first 12 scenes of"),
        ] {
            let drawing = drawn(scenes, participants);
            let svg = drawing.svg();
            for words in ["(°)", "(m)", "(s)", "made-up study", title] {
                assert!(svg.contains(words), "{words}");
            }
            // The length of the scale bar.
            assert!(svg.contains(">10 m<") || svg.contains(">5 m<"));
            assert!(!svg.contains("NaN") && !svg.contains("inf"));
            assert!(drawing.size[0] <= 1280.0, "{:?}", drawing.size);
            assert!(png(&drawing).unwrap().starts_with(b"\x89PNG"));
        }
    }
}
