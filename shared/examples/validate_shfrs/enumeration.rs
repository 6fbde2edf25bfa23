//! Enumerates all inputs that switch twice. Does one of them end at each point of the boundary?

use serde_json::json;
use sidestep::math::{SeededRng, hypot};
use sidestep::reach::PolygonSettings;
use sidestep::vehicle::{Pose, dubins};

use crate::drives::{KINDS, Kind, Rates, set};
use crate::{Found, SPEED_MPS, STEP_S};

/// Number of steps, and of parts per step. The enumerated inputs switch between parts. Two switches
/// suffice for any bounds over three steps, and over ten steps if straight driving is always
/// admitted.
const SHORT: (usize, usize) = (3, 12);
const LONG: (usize, usize) = (10, 4);
/// Number of bounds of each kind.
const BOUNDS: usize = 10;
/// After the enumeration, the switching times of the inputs that end nearest to the point are
/// refined. The refinement stops when an end is within `NEAR_M` of the point, or when changes by
/// `LEAST_MOVE_S` no longer help.
const NEAR_M: f64 = 1e-4;
const LEAST_MOVE_S: f64 = 1e-5;
/// Number of rate sequences whose nearest input is refined.
const NEAREST: usize = 6;

/// An input with three successive rates and two switching times (s). A rate is the lowest (0), the
/// straightest (1) or the highest (2) that is admitted.
#[derive(Clone, Copy)]
struct Input {
    rates: [usize; 3],
    switches: [f64; 2],
}

impl Input {
    fn end(&self, (lo, hi): &Rates) -> [f64; 2] {
        let mut pose = Pose::new(0.0, 0.0, 0.0);
        for (i, (&low, &high)) in lo.iter().zip(hi).enumerate() {
            let choices = [low, 0.0_f64.clamp(low, high), high];
            let (begin, end) = (i as f64 * STEP_S, (i + 1) as f64 * STEP_S);
            let [first, second] = self.switches.map(|at| at.clamp(begin, end));
            let cuts = [begin, first, second, end];
            for (choice, cut) in self.rates.iter().zip(cuts.windows(2)) {
                if cut[1] > cut[0] {
                    pose = dubins::arc(pose, SPEED_MPS, choices[*choice], cut[1] - cut[0]);
                }
            }
        }
        pose.position()
    }
}

/// Every sequence of rates, with every pair of switching times between parts.
fn enumerated(rates: &Rates, parts: usize) -> Vec<Vec<(Input, [f64; 2])>> {
    let parts_in_all = rates.0.len() * parts;
    let at = |part: usize| part as f64 * STEP_S / parts as f64;
    let sequence = |code: usize| {
        let kinds = [code % 3, code / 3 % 3, code / 9];
        let pairs = (0..=parts_in_all).flat_map(|i| (i..=parts_in_all).map(move |j| (i, j)));
        let input = |(i, j)| {
            let input = Input { rates: kinds, switches: [at(i), at(j)] };
            (input, input.end(rates))
        };
        pairs.map(input).collect()
    };
    (0..27).map(sequence).collect()
}

/// Distance from `point` to the nearest end (m), after refinement of the switching times.
fn distance(inputs: &[Vec<(Input, [f64; 2])>], point: [f64; 2], rates: &Rates, part: f64) -> f64 {
    let from = |end: [f64; 2]| hypot(end[0] - point[0], end[1] - point[1]);
    let nearest = |inputs: &Vec<(Input, [f64; 2])>| {
        let distances = inputs.iter().map(|(input, end)| (from(*end), *input));
        distances.min_by(|a, b| a.0.total_cmp(&b.0))
    };
    let mut best: Vec<(f64, Input)> = inputs.iter().filter_map(nearest).collect();
    best.sort_by(|a, b| a.0.total_cmp(&b.0));
    best.truncate(NEAREST);
    let until = rates.0.len() as f64 * STEP_S;
    for (least, input) in &mut best {
        let mut by = part;
        while *least > NEAR_M && by > LEAST_MOVE_S {
            let (before, Input { switches: [first, second], .. }) = (*least, *input);
            for (a, b) in [-by, 0.0, by].into_iter().flat_map(|a| [-by, 0.0, by].map(|b| (a, b))) {
                let first = (first + a).clamp(0.0, until);
                let switches = [first, (second + b).clamp(first, until)];
                let tried = Input { switches, ..*input };
                let found = from(tried.end(rates));
                if found < *least {
                    (*least, *input) = (found, tried);
                }
            }
            if *least == before {
                by *= 0.5;
            }
        }
        if *least <= NEAR_M {
            return *least;
        }
    }
    best.iter().map(|(least, _)| *least).fold(f64::INFINITY, f64::min)
}

pub(crate) fn check() -> Found {
    let mut rng = SeededRng::new(62);
    let settings = PolygonSettings::new(1e-3, 2)?;
    let short = KINDS.map(|kind| (kind, SHORT));
    let long = [Kind::Everything, Kind::Straight].map(|kind| (kind, LONG));
    let mut checks = Vec::new();
    for (kind, (steps, parts)) in short.into_iter().chain(long) {
        // The bounds that admit every turn rate are unique, so they are tested only once.
        let bounds = if kind == Kind::Everything { 1 } else { BOUNDS };
        let (mut tried, mut points, mut farthest_m) = (0, 0, 0.0_f64);
        for _ in 0..bounds {
            let rates = kind.bounds(steps, &mut rng);
            let inputs = enumerated(&rates, parts);
            tried += inputs.iter().map(Vec::len).sum::<usize>();
            let polygon = set(Pose::new(0.0, 0.0, 0.0), &rates)?.step_polygon(steps, settings);
            points += polygon.len();
            let part = STEP_S / parts as f64;
            let distances = polygon.iter().map(|&point| distance(&inputs, point, &rates, part));
            farthest_m = distances.fold(farthest_m, f64::max);
        }
        checks.push(json!({
            "kind": kind,
            "steps": steps,
            "bounds": bounds,
            "inputs": tried,
            // Number of boundary points, and the maximum distance of a boundary point from the
            // nearest end.
            "points": points,
            "farthest_m": farthest_m,
        }));
    }
    Ok(checks.into())
}
