//! `sidestep reach`.

use super::CommandError;
use super::degrees::Degrees;
use super::json_file::JsonArgs;
use core::fmt;
use serde::de::value::SeqAccessDeserializer;
use serde::de::{SeqAccess, Visitor};
use serde::{Deserialize, Deserializer, Serialize};
use sidestep::bounds::InputBounds;
use sidestep::invalid::{Invalid, positive};
use sidestep::math::PI;
use sidestep::reach::polygon::{bounding_box, signed_area, signed_distance};
use sidestep::reach::{PolygonSettings, PositionUncertainty, ReachableSet, StartSet, Tolerance};
use sidestep::vehicle::{Pose, SpeedRange};

/// Compute reachable sets under bounds on the turn rate, and test whether states are in them.
///
/// The input, in m, s and rad, with headings counter-clockwise from +x, is {"speed": 2, "dt": 0.2,
/// "turn_rate": [-0.5, 0.5], "initial": [x, y, psi], "sets": [{"lo": [one rate per step], "hi":
/// […], "queries": [{"step": n, "state": [x, y, psi]}]}], "tolerance": {"position": 0.005,
/// "heading": 0.002}, "accuracy": 0.0001, "conservative": false}. "queries", "tolerance",
/// "accuracy" and "conservative" are optional; the defaults are shown. A state counts as inside if
/// it is outside by at most the tolerance. Edges of polygons are within the accuracy (m) of the
/// true boundary, on either side; holes are filled. Where this accuracy would take too much work
/// (large turns per step, many steps, high accuracy), polygons are larger and contain the set.
/// Bounds that forbid straight driving by less than 1e-4 rad/s are treated as allowing it.
///
/// "speed" is a constant speed (m/s), or [lowest, highest] for a vehicle that changes its speed at
/// any time.
///
/// Conservative polygons, areas and boxes are slightly larger, so that they contain the whole set
/// under all bounds. Where they would take too much work, their error can exceed the accuracy.
/// Queries still test the exact set. With a range of speeds, "full" is true if the heading is
/// admissible and the position is inside a conservative polygon. "full" never misses a reachable state. At large turns per step
/// it can be true for an unreachable state, if unreachability is not proved.
///
/// An uncertain start adds "start": {"disc": r, "heading": δ} or {"box": [along, across],
/// "heading": δ}, where each part is optional. With "disc", the start position is within r metres of
/// "initial". With "box", it is at most "along" metres ahead of or behind "initial", and at most
/// "across" metres to its left or right. The heading is within δ rad of that of "initial". The sets contain everything that is reachable from any of these poses. With an
/// uncertain heading, a "full" query may take a second.
///
/// The answer, in world coordinates, is {"sets": [{"steps": [{"step", "t", "area", "bbox": [x0, y0,
/// x1, y1], "polygon": [[x, y], …]}, …], "tube": {"area", "bbox", "polygon"}, "queries":
/// [{"planar", "full"}]}]}. Steps 1 to T have the positions reachable after exactly this number of
/// steps; the tube is the union over the whole time. Polygons are counter-clockwise, and their
/// first vertex is not repeated; a set with a single position has one vertex. For a query,
/// "planar" states whether its position is reachable after this step (0 to T) with any heading, and
/// "full" whether it is reachable with the given heading.
#[derive(Clone, Debug, clap::Args)]
pub struct ReachArgs {
    #[command(flatten)]
    files: JsonArgs,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Input {
    speed: SpeedInput,
    dt: f64,
    turn_rate: (f64, f64),
    initial: Pose,
    start: Option<StartInput>,
    sets: Vec<SetInput>,
    tolerance: Option<ToleranceInput>,
    accuracy: Option<f64>,
    #[serde(default)]
    conservative: bool,
}

/// A constant speed, or the lowest and the highest speed.
#[derive(Clone, Copy)]
enum SpeedInput {
    Constant(f64),
    Range([f64; 2]),
}

impl<'de> Deserialize<'de> for SpeedInput {
    fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        struct Reader;

        impl<'de> Visitor<'de> for Reader {
            type Value = SpeedInput;

            fn expecting(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
                out.write_str("a number or [lowest, highest]")
            }

            fn visit_f64<E>(self, speed: f64) -> Result<SpeedInput, E> {
                Ok(SpeedInput::Constant(speed))
            }

            fn visit_u64<E>(self, speed: u64) -> Result<SpeedInput, E> {
                Ok(SpeedInput::Constant(speed as f64))
            }

            fn visit_i64<E>(self, speed: i64) -> Result<SpeedInput, E> {
                Ok(SpeedInput::Constant(speed as f64))
            }

            fn visit_seq<A: SeqAccess<'de>>(self, seq: A) -> Result<SpeedInput, A::Error> {
                <[f64; 2]>::deserialize(SeqAccessDeserializer::new(seq)).map(SpeedInput::Range)
            }
        }

        from.deserialize_any(Reader)
    }
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct StartInput {
    disc: Option<f64>,
    #[serde(rename = "box")]
    sides: Option<[f64; 2]>,
    #[serde(default)]
    heading: f64,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct SetInput {
    lo: Vec<f64>,
    hi: Vec<f64>,
    #[serde(default)]
    queries: Vec<Query>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Query {
    step: usize,
    state: Pose,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct ToleranceInput {
    position: f64,
    heading: f64,
}

#[derive(Serialize)]
struct Answer {
    sets: Vec<SetAnswer>,
}

#[derive(Serialize)]
struct SetAnswer {
    steps: Vec<StepAnswer>,
    tube: Area,
    queries: Vec<QueryAnswer>,
}

#[derive(Serialize)]
struct StepAnswer {
    step: usize,
    t: f64,
    #[serde(flatten)]
    area: Area,
}

#[derive(Serialize)]
struct Area {
    area: f64,
    bbox: [f64; 4],
    polygon: Vec<[f64; 2]>,
}

#[derive(Serialize)]
struct QueryAnswer {
    planar: bool,
    full: bool,
}

/// Upper bound on the number of steps of a set. The total size of all polygons grows with the
/// square of this number.
pub(super) const MOST_STEPS: usize = 300;

/// In an error, replaces the library's name of a field by the field's name in the document.
fn named(invalid: Invalid) -> Invalid {
    let field = match invalid.field.as_str() {
        "speed_mps" => "speed",
        "step_s" => "dt",
        "start.x" | "start.y" | "start.psi" => "initial",
        other => other,
    };
    Invalid { field: field.to_owned(), ..invalid }
}

/// Reads the document, computes the sets, and writes the answer.
///
/// # Errors
/// [`CommandError`] for an invalid document, naming the field (input), or if the answer cannot be
/// written (failure).
pub async fn run(args: ReachArgs) -> Result<(), CommandError> {
    let input: Input = args.files.read()?;
    let answer = answer(&input).map_err(|invalid| args.files.document().complain(&invalid))?;
    let mut degrees = Degrees::of(args.files.document().name());
    degrees.look(input.initial.psi, || "initial[2]".to_owned());
    for (j, set) in input.sets.iter().enumerate() {
        for (q, query) in set.queries.iter().enumerate() {
            degrees.look(query.state.psi, || format!("sets[{j}].queries[{q}].state[2]"));
        }
    }
    degrees.warn();
    args.files.answer(&answer)
}

fn answer(input: &Input) -> Result<Answer, Invalid> {
    let speed = speed(input.speed)?;
    positive("dt", input.dt)?;
    input.initial.check().map_err(|invalid| invalid.within("initial"))?;
    let (least, most) = input.turn_rate;
    if least.abs().max(most.abs()) * input.dt > PI {
        let found = format!("[{least}, {most}] for {} s", input.dt);
        return Err(Invalid::new("turn_rate", "at most half a turn a step", found));
    }
    for (j, set) in input.sets.iter().enumerate() {
        if set.lo.len() > MOST_STEPS {
            let expected = format!("at most {MOST_STEPS} steps");
            return Err(Invalid::new(format!("sets[{j}].lo"), expected, set.lo.len()));
        }
    }
    let settings = PolygonSettings::default();
    let settings = match input.accuracy {
        None => settings,
        Some(accuracy) => PolygonSettings::new(accuracy, settings.least_pieces())
            .map_err(|invalid| Invalid { field: "accuracy".to_owned(), ..invalid })?,
    };
    let settings = if input.conservative { settings.conservative() } else { settings };
    let tolerance = tolerance(input.tolerance.as_ref())?;
    if input.sets.is_empty() {
        return Err(Invalid::new("sets", "at least one set", "none"));
    }
    let start = start(input)?;
    let sets = input.sets.iter().enumerate().map(|(j, set)| {
        set_answer(input, (start, speed), set, settings, tolerance).map_err(|invalid| {
            let named = named(invalid.clone());
            // If the field was renamed, it belongs to the whole document and not to one set.
            if named == invalid { named.within(&format!("sets[{j}]")) } else { named }
        })
    });
    Ok(Answer { sets: sets.collect::<Result<_, _>>()? })
}

fn speed(given: SpeedInput) -> Result<SpeedRange, Invalid> {
    match given {
        SpeedInput::Constant(speed) => positive("speed", speed).map(SpeedRange::from),
        SpeedInput::Range([lo, hi]) => SpeedRange::new(lo, hi).map_err(named),
    }
}

fn start(input: &Input) -> Result<StartSet, Invalid> {
    let Some(given) = &input.start else {
        return Ok(input.initial.into());
    };
    let position = match (given.disc, given.sides) {
        (None, None) => PositionUncertainty::None,
        (Some(radius_m), None) => PositionUncertainty::Disc { radius_m },
        (None, Some([along_m, across_m])) => PositionUncertainty::Box { along_m, across_m },
        (Some(_), Some(_)) => return Err(Invalid::new("start", "a disc or a box", "both")),
    };
    StartSet::new(input.initial, position, given.heading).map_err(|invalid| {
        let field = match invalid.field.as_str() {
            "radius_m" => "start.disc",
            "along_m" => "start.box[0]",
            "across_m" => "start.box[1]",
            _ => "start.heading",
        };
        Invalid { field: field.to_owned(), ..invalid }
    })
}

fn tolerance(given: Option<&ToleranceInput>) -> Result<Tolerance, Invalid> {
    let Some(given) = given else {
        return Ok(Tolerance::default());
    };
    for (name, value) in [("position", given.position), ("heading", given.heading)] {
        if !(value.is_finite() && value >= 0.0) {
            let field = format!("tolerance.{name}");
            return Err(Invalid::new(field, "a finite number ≥ 0", value));
        }
    }
    Ok(Tolerance { position_m: given.position, heading_rad: given.heading })
}

fn set_answer(
    input: &Input,
    (start, speed): (StartSet, SpeedRange),
    given: &SetInput,
    settings: PolygonSettings,
    tolerance: Tolerance,
) -> Result<SetAnswer, Invalid> {
    let bounds = InputBounds::new(given.lo.clone(), given.hi.clone(), input.turn_rate)?;
    let set = ReachableSet::new(start, &bounds, speed, input.dt)?;
    let polygons: Vec<_> = (0..=set.steps()).map(|step| set.step_polygon(step, settings)).collect();
    // Queries test the exact set. Conservative polygons are larger, so queries do not use them.
    let mut exact: Vec<Option<Vec<[f64; 2]>>> = vec![None; polygons.len()];
    let exact_settings = PolygonSettings::new(settings.accuracy_m(), settings.least_pieces())?;
    let queries = given.queries.iter().enumerate().map(|(q, query)| {
        let Some(polygon) = polygons.get(query.step) else {
            let expected = format!("a step from 0 to {}", set.steps());
            return Err(Invalid::new(format!("queries[{q}].step"), expected, query.step));
        };
        let position = query.state.position();
        let beyond_m = if input.conservative {
            let make = || set.step_polygon(query.step, exact_settings);
            signed_distance(exact[query.step].get_or_insert_with(make), position)
        } else {
            signed_distance(polygon, position)
        };
        Ok(QueryAnswer {
            planar: beyond_m <= tolerance.position_m,
            full: set.contains_state(query.step, query.state, tolerance),
        })
    });
    let queries = queries.collect::<Result<_, _>>()?;
    let tube = area(set.tube_polygon(settings));
    let steps = polygons.into_iter().enumerate().skip(1);
    let steps = steps
        .map(|(step, polygon)| StepAnswer { step, t: step as f64 * input.dt, area: area(polygon) })
        .collect();
    Ok(SetAnswer { steps, tube, queries })
}

fn area(polygon: Vec<[f64; 2]>) -> Area {
    let bbox = bounding_box(&polygon).unwrap_or([f64::NAN; 4]);
    // Rounding errors could give a set of zero width a negative area.
    Area { area: signed_area(&polygon).max(0.0), bbox, polygon }
}
