//! Converged value of a pursuit game in polar relative coordinates.
//!
//! State: range r, bearing α of the pursuer from the evader's heading, relative
//! heading ψ. With β = ψ − α, the pursuer's heading against the line of sight,
//!
//! ṙ = v_p cos β − v_e cos α, α̇ = q/r − a, ψ̇ = b − a, q = v_e sin α + v_p sin β:
//!
//! range is a plain advection and the turn rates only shift the two angles, so each
//! axis is upwinded exactly, without Lax–Friedrichs dissipation. The unknown is the
//! deficit W = V − (r − R), between −r and 0, which is 0 at r = 0 and wherever the range only
//! opens. The range axis is r = c (eˢ − 1) with s uniform: linear near the danger
//! zone, logarithmic far out, so a long range costs little. Mirror symmetry
//! (α, ψ) → (−α, −ψ) leaves α in [0, π] to be solved.
//!
//! The evader's turn enters both angles. At equal headings V has a ridge along ψ = 0
//! that the evader keeps by copying the pursuer's turn, so the discrete Hamiltonian is
//! min over b of max over a: the evader answers. Any other order, or the aspect β in
//! place of ψ, wears the ridge away by some tenths of a metre.
//!
//! Only the converged value is wanted, so every cell takes its own largest stable
//! time step, new values are used at once (Gauss–Seidel), the sweeps change
//! direction, rows that rest are skipped, and coarser grids give the first guess.

use super::grid::check_memory;
use super::parallel::{Kernel, in_widest_lanes};
use super::pursuit::{Player, PursuitGame};
use super::real::Real;
use super::{Progress, SolveError};
use crate::invalid::{Invalid, positive};
use crate::math::{TAU, exp, ln, power_of_two_near, sin_cos};
use core::ops::ControlFlow;

/// Nodes in polar coordinates, and how far the solve goes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settings {
    /// Largest range, m.
    pub range_m: f64,
    /// Nodes of the range axis, the one at 0 included.
    pub range_nodes: usize,
    /// Nodes of a full turn of bearing and of heading: a multiple of 4.
    pub angle_nodes: usize,
    /// Converged when the mean drift of a row in [`WINDOW`] sweeps is below this share of
    /// the radius. Where turns are so fast that a sweep covers little time, less.
    pub tolerance: f64,
    /// At most this many sweeps over any grid.
    pub most_sweeps: usize,
    /// Refuse anything that would take more memory.
    pub memory_limit_bytes: u64,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            range_m: 40.0,
            range_nodes: 65,
            angle_nodes: 96,
            tolerance: 1e-4,
            most_sweeps: 2000,
            memory_limit_bytes: super::MEMORY_LIMIT_BYTES,
        }
    }
}

/// The range axis r = c (eˢ − 1), s = 0, h, 2h, …
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RangeAxis {
    /// c, m: where the axis turns from linear to logarithmic.
    pub knee_m: f64,
    /// h.
    pub step: f64,
    /// Number of nodes.
    pub nodes: usize,
}

impl RangeAxis {
    /// `nodes` nodes from 0 to `range_m`.
    #[must_use]
    pub fn new(knee_m: f64, range_m: f64, nodes: usize) -> Self {
        Self { knee_m, step: ln(1.0 + range_m / knee_m) / (nodes - 1) as f64, nodes }
    }

    /// Range of node `i`, m.
    #[must_use]
    pub fn node(&self, i: usize) -> f64 {
        self.knee_m * (exp(i as f64 * self.step) - 1.0)
    }

    /// Fractional node index of a range, m.
    #[must_use]
    pub fn position(&self, range_m: f64) -> f64 {
        ln(1.0 + range_m / self.knee_m) / self.step
    }
}

/// The deficit W on the nodes.
#[derive(Clone, Debug)]
pub struct Solution<T> {
    /// Range axis.
    pub range: RangeAxis,
    /// Last range, m.
    pub range_m: f64,
    /// Nodes of a full turn.
    pub angle_nodes: usize,
    /// W(range, bearing in [0, π], heading in [0, 2π)), row-major, m: bearing has
    /// `angle_nodes / 2 + 1` nodes, heading `angle_nodes`.
    pub deficit: Vec<T>,
    /// Q(range, bearing in [0, 2π), heading in [0, 2π)): W(α, ψ) is the larger of
    /// Q(α, ψ) and Q(−α, −ψ). Near the surface where the evader is free to turn
    /// either way, Q is the smooth continuation of the side where it turns right;
    /// elsewhere Q = W.
    pub sheet: Vec<T>,
    /// Sweeps over the finest grid.
    pub sweeps: usize,
    /// How much a row still drifts in [`WINDOW`] sweeps, its signed changes summed
    /// and averaged, and that averaged over the rows, m. Cells on a kink that
    /// flicker between both sides cancel out.
    pub drift_m: f64,
    /// Whether that was within the tolerance.
    pub converged: bool,
}

/// Solves for the converged value.
///
/// # Errors
/// [`SolveError::Invalid`] naming a parameter; [`SolveError::Cancelled`].
pub fn solve<T: Real>(
    game: &PursuitGame,
    settings: &Settings,
    progress: &mut dyn FnMut(Progress) -> ControlFlow<()>,
) -> Result<Solution<T>, SolveError> {
    game.check()?;
    positive("range_m", settings.range_m)?;
    positive("tolerance", settings.tolerance)?;
    if settings.range_m <= game.radius_m {
        let expected = format!("above the radius {}", game.radius_m);
        return Err(Invalid::new("range_m", expected, settings.range_m).into());
    }
    if settings.range_nodes < 9 {
        return Err(Invalid::new("range_nodes", "at least 9", settings.range_nodes).into());
    }
    if settings.angle_nodes < 12 || !settings.angle_nodes.is_multiple_of(4) {
        let expected = "a multiple of 4, at least 12";
        return Err(Invalid::new("angle_nodes", expected, settings.angle_nodes).into());
    }
    let half = settings.angle_nodes / 2 + 1;
    let nodes = settings.range_nodes.saturating_mul(half).saturating_mul(settings.angle_nodes);
    // The half turn and its copy, the full turn of the sheet and its copy.
    check_memory(nodes, 6, size_of::<T>(), settings.memory_limit_bytes)?;

    // Lengths in units of about R/3 and time so that the faster player has a speed
    // between 1 and 2: what is small is small for any vehicle, and powers of two round
    // nothing.
    let unit = game.length_unit_m();
    let fastest = game.evader.speed_mps.max(game.pursuer.speed_mps) / unit;
    let rate = power_of_two_near(fastest);
    let scaled = |player: Player| Player {
        speed_mps: player.speed_mps / unit / rate,
        turn_rate_radps: player.turn_rate_radps / rate,
    };
    let small = PursuitGame {
        evader: scaled(game.evader),
        pursuer: scaled(game.pursuer),
        radius_m: game.radius_m / unit,
    };
    for (name, player) in [("evader", small.evader), ("pursuer", small.pursuer)] {
        let smallest = f64::from(f32::MIN_POSITIVE);
        if player.speed_mps < smallest || player.turn_rate_radps < smallest {
            let expected = "a speed and a turn rate that single precision can tell from zero \
                            beside those of the other player";
            let found = format!(
                "{} m/s, {} rad/s",
                player.speed_mps * unit * rate,
                player.turn_rate_radps * rate
            );
            return Err(Invalid::new(name, expected, found).into());
        }
    }
    let pace = pace(&small);
    if pace < SLOWEST_PACE {
        let turns = |evader: f64, pursuer: f64| 2.0 * evader + pursuer;
        let most =
            turns(game.evader.turn_rate_radps, game.pursuer.turn_rate_radps) * pace / SLOWEST_PACE;
        let expected = format!(
            "turn rates that the grid can follow: twice the evader's and the pursuer's together \
             at most about {most:.0} rad/s"
        );
        let found = turns(game.evader.turn_rate_radps, game.pursuer.turn_rate_radps);
        return Err(Invalid::new("turn_rate_radps", expected, found).into());
    }

    let levels = levels(settings);
    let count = levels.len();
    let mut solved: Option<Level<T>> = None;
    for (i, (range_nodes, angle_nodes)) in levels.into_iter().enumerate() {
        let mut level =
            Level::new(&small, settings.range_m / unit, range_nodes, angle_nodes, Evader::Free);
        if let Some(coarser) = &solved {
            level.start_from(coarser);
        }
        // Errors of the grid fall with the square of the spacing, and the first
        // guess need not be better than that.
        let finer = (settings.angle_nodes / angle_nodes) as f64;
        let tolerance = settings.tolerance * small.radius_m * pace * finer * finer;
        let mut report = |drift: f64, sweep: usize| {
            let within = 1.0 - 1.0 / (1.0 + sweep as f64 / 50.0);
            progress(Progress { done: (i as f64 + within) / count as f64, residual: drift * unit })
        };
        if level.converge(tolerance, settings.most_sweeps, &mut report).is_break() {
            return Err(SolveError::Cancelled);
        }
        level.converged = level.drift_m <= tolerance;
        solved = Some(level);
    }
    match solved {
        Some(full) => {
            let sheet = full.right_sheet();
            let mut solution = full.finish(sheet);
            solution.range = RangeAxis::new(game.radius_m, settings.range_m, settings.range_nodes);
            solution.range_m = settings.range_m;
            solution.drift_m *= unit;
            let metres = T::from_f64(unit);
            for w in solution.deficit.iter_mut().chain(&mut solution.sheet) {
                *w = *w * metres;
            }
            Ok(solution)
        }
        None => unreachable!("there is always the grid asked for"),
    }
}

/// How much of a game [`WINDOW`] sweeps cover, against what they cover of the paper's: at
/// most 1. A cell's time step is short where an angle may change quickly.
fn pace(game: &PursuitGame) -> f64 {
    let PursuitGame { evader, pursuer, radius_m } = *game;
    let closing = (evader.speed_mps + pursuer.speed_mps) / radius_m;
    let turns = 2.0 * evader.turn_rate_radps + pursuer.turn_rate_radps + closing;
    let radians = evader.speed_mps.max(pursuer.speed_mps) / radius_m / turns;
    (radians / PAPERS_PACE).min(1.0)
}

/// Radians that a vehicle drives round a circle of the radius while the angles could turn
/// by one, a little below what they are in the paper's game (0.235).
const PAPERS_PACE: f64 = 0.22;
/// Below this single precision no longer sees what a sweep changes.
const SLOWEST_PACE: f64 = 0.02;

/// Sweeps between two looks at the drift.
pub const WINDOW: usize = 16;

/// Coarse to fine.
fn levels(settings: &Settings) -> Vec<(usize, usize)> {
    let mut levels = vec![(settings.range_nodes, settings.angle_nodes)];
    let (mut range, mut angle) = levels[0];
    while angle.is_multiple_of(8) && angle >= 48 && range >= 33 {
        (range, angle) = (range.div_ceil(2), angle / 2);
        levels.push((range, angle));
    }
    levels.reverse();
    levels
}

/// Ghost entries at each end of a row, so that shifted reads stay inside.
const PAD: usize = 2;

/// Which turns the evader may choose from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Evader {
    /// All; the value is symmetric and half a turn of bearings is solved.
    Free,
    /// Right or straight until the range need not close any more; there is no
    /// symmetry, and the bearings are a full turn.
    Right,
}

/// One grid being solved.
struct Level<T> {
    game: PursuitGame,
    evader: Evader,
    range: RangeAxis,
    range_m: f64,
    angle_nodes: usize,
    /// Bearing rows per range, with `PAD` mirrored or repeated ones at each end.
    rows: usize,
    /// Entries of a row: one turn and `PAD` repeated ones at each end.
    row: usize,
    values: Vec<T>,
    /// Largest change of each row when it was last updated.
    activity: Vec<T>,
    /// Signed change of each row since the last look, summed over its cells.
    drift: Vec<T>,
    /// Of the angles j·2π/`angle_nodes`.
    sin: Vec<T>,
    cos: Vec<T>,
    /// Of the nodes, m.
    ranges: Vec<f64>,
    sweeps: usize,
    drift_m: f64,
    converged: bool,
}

impl<T: Real> Level<T> {
    fn new(
        game: &PursuitGame,
        range_m: f64,
        range_nodes: usize,
        angle_nodes: usize,
        evader: Evader,
    ) -> Self {
        let bearings = match evader {
            Evader::Free => angle_nodes / 2 + 1,
            Evader::Right => angle_nodes,
        };
        let rows = bearings + 2 * PAD;
        let row = angle_nodes + 2 * PAD;
        let trig = |f: fn((f64, f64)) -> f64| -> Vec<T> {
            let angle = |j: usize| TAU * j as f64 / angle_nodes as f64;
            (0..angle_nodes).map(|j| T::from_f64(f(sin_cos(angle(j))))).collect()
        };
        let range = RangeAxis::new(game.radius_m, range_m, range_nodes);
        Self {
            game: *game,
            evader,
            range,
            range_m,
            ranges: (0..range_nodes).map(|i| range.node(i)).collect(),
            drift: vec![T::ZERO; range_nodes * bearings],
            angle_nodes,
            rows,
            row,
            // Two ghost ranges beyond each end.
            values: vec![T::ZERO; (range_nodes + 2 * PAD) * rows * row],
            activity: vec![T::from_f64(f64::MAX); range_nodes * bearings],
            sin: trig(|(sin, _)| sin),
            cos: trig(|(_, cos)| cos),
            sweeps: 0,
            drift_m: f64::INFINITY,
            converged: false,
        }
    }

    /// Start of the row of range node `i` and bearing node `k`.
    fn at(&self, i: usize, k: usize) -> usize {
        ((i + PAD) * self.rows + k + PAD) * self.row
    }

    fn bearings(&self) -> usize {
        self.rows - 2 * PAD
    }

    /// Linear interpolation of a grid with (about) half as many nodes an axis.
    fn start_from(&mut self, coarse: &Self) {
        let angles = self.angle_nodes;
        for i in 1..self.range.nodes {
            let position = coarse.range.position(self.ranges[i]);
            let low = (position as usize).min(coarse.range.nodes - 2);
            let share = T::from_f64((position - low as f64).clamp(0.0, 1.0));
            for k in 0..self.bearings() {
                let to = self.at(i, k);
                for j in 0..angles {
                    let mut sum = T::ZERO;
                    for (range, weight) in [(low, T::from_f64(1.0) - share), (low + 1, share)] {
                        for bearing in [k / 2, k.div_ceil(2)] {
                            for heading in [j / 2, j.div_ceil(2) % coarse.angle_nodes] {
                                let from = coarse.at(range, bearing) + PAD + heading;
                                sum += weight * coarse.values[from];
                            }
                        }
                    }
                    self.values[to + PAD + j] = sum * T::from_f64(0.25);
                }
            }
        }
        for i in 0..self.range.nodes {
            for k in 0..self.bearings() {
                self.spread(i, k);
            }
        }
    }

    /// Copies a row to its ghosts: round the turn, beyond the mirror and beyond
    /// the ends of the range.
    fn spread(&mut self, i: usize, k: usize) {
        let (n, last) = (self.angle_nodes, self.bearings() - 1);
        let at = self.at(i, k);
        let row = &mut self.values[at..at + self.row];
        row.copy_within(n..n + PAD, 0);
        row.copy_within(PAD..2 * PAD, n + PAD);
        if self.evader == Evader::Right {
            let turn = self.bearings() * self.row;
            if k < PAD {
                self.values.copy_within(at..at + self.row, at + turn);
            } else if k > last - PAD {
                self.values.copy_within(at..at + self.row, at - turn);
            }
        }
        let mirrored = if self.evader == Evader::Right {
            None
        } else if (1..=PAD).contains(&k) {
            Some(at - 2 * k * self.row)
        } else if k < last && last - k <= PAD {
            Some(at + 2 * (last - k) * self.row)
        } else {
            None
        };
        if let Some(ghost) = mirrored {
            for j in 0..self.row {
                // Heading j − PAD becomes its negative.
                let source = at + PAD + (2 * n + PAD - j) % n;
                self.values[ghost + j] = self.values[source];
            }
        }
        if i == self.range.nodes - 1 {
            // Beyond the last range the deficit stays what it is there.
            for ghost in 1..=PAD {
                let to = at + ghost * self.rows * self.row;
                self.values.copy_within(at..at + self.row, to);
            }
        }
    }

    fn converge(
        &mut self,
        tolerance: f64,
        most_sweeps: usize,
        report: &mut dyn FnMut(f64, usize) -> ControlFlow<()>,
    ) -> ControlFlow<()> {
        while self.sweeps < most_sweeps && self.drift_m > tolerance {
            in_widest_lanes(Sweep { level: self, rest: T::from_f64(tolerance), full: None });
            if self.sweeps.is_multiple_of(WINDOW) {
                let sum: f64 = self.drift.iter().map(|drift| drift.abs().to_f64()).sum();
                self.drift_m = sum / (self.drift.len() * self.angle_nodes) as f64;
                self.drift.fill(T::ZERO);
            }
            report(self.drift_m, self.sweeps)?;
        }
        ControlFlow::Continue(())
    }

    /// Writes W of the full game at any bearing, from its half turn, to `row`.
    #[inline(always)]
    fn copy_row(&self, i: usize, k: usize, row: &mut [T]) {
        let n = self.angle_nodes;
        if k <= n / 2 {
            row.copy_from_slice(&self.values[self.at(i, k) + PAD..][..n]);
        } else {
            // Heading j of the mirror image is n − j: the row backwards, from its
            // repeated first entry on.
            let mirrored = &self.values[self.at(i, n - k) + PAD + 1..][..n];
            for (to, from) in row.iter_mut().zip(mirrored.iter().rev()) {
                *to = *from;
            }
        }
    }

    /// The game in which the evader turns right or goes straight until it is safe
    /// in the full game, that is `self`.
    fn right_sheet(&self) -> Self {
        let (n, ranges) = (self.angle_nodes, self.range.nodes);
        let mut sheet = Self::new(&self.game, self.range_m, ranges, n, Evader::Right);
        for i in 0..ranges {
            for k in 0..n {
                let at = sheet.at(i, k) + PAD;
                self.copy_row(i, k, &mut sheet.values[at..at + n]);
                sheet.spread(i, k);
            }
        }
        // The full game is right wherever the evader turns right anyway, so only a
        // few cells beyond the kink have to find their values.
        let rest = T::from_f64(SAFE * self.game.radius_m);
        for _ in 0..SHEET_SWEEPS {
            in_widest_lanes(Sweep { level: &mut sheet, rest, full: Some(self) });
        }
        sheet
    }

    /// Copies what is inside the ghosts.
    fn inside(&self) -> Vec<T> {
        let mut values = Vec::with_capacity(self.range.nodes * self.bearings() * self.angle_nodes);
        for i in 0..self.range.nodes {
            for k in 0..self.bearings() {
                let at = self.at(i, k) + PAD;
                values.extend_from_slice(&self.values[at..at + self.angle_nodes]);
            }
        }
        values
    }

    /// Puts the sheet in where it explains the full game, near the kink.
    fn finish(mut self, mut sheet: Self) -> Solution<T> {
        let (n, ranges) = (self.angle_nodes, self.range.nodes);
        for i in 0..ranges {
            let next = self.ranges[(i + 1).min(ranges - 1)] - self.ranges[i];
            let cell = next.max(self.ranges[i] * TAU / n as f64);
            let (near, blur) = (T::from_f64(KINK_NEAR * cell), T::from_f64(KINK_BLUR * cell));
            for k in 0..=n / 2 {
                // Rows on the mirror hold each state twice.
                let own_mirror = k == 0 || k == n / 2;
                for j in 0..if own_mirror { n / 2 + 1 } else { n } {
                    let at = self.at(i, k) + PAD + j;
                    let right = sheet.at(i, k) + PAD + j;
                    let left = sheet.at(i, (n - k) % n) + PAD + (n - j) % n;
                    let full = self.values[at];
                    let (a, b) = (sheet.values[right], sheet.values[left]);
                    let both = a.larger(b);
                    let explained = (full - both).abs() <= blur && (a - b).abs() <= near;
                    if explained {
                        self.values[at] = both;
                        if own_mirror {
                            let twin = self.at(i, k) + PAD + (n - j) % n;
                            self.values[twin] = both;
                        }
                    } else {
                        sheet.values[right] = full;
                        sheet.values[left] = full;
                    }
                }
            }
        }
        // One after the other, so that no more than three full grids exist.
        let deficit = self.inside();
        self.values = Vec::new();
        let sheet = sheet.inside();
        Solution {
            range: self.range,
            range_m: self.range_m,
            angle_nodes: self.angle_nodes,
            deficit,
            sheet,
            sweeps: self.sweeps,
            drift_m: self.drift_m,
            converged: self.converged,
        }
    }
}

/// One pass over all rows.
struct Sweep<'a, T> {
    level: &'a mut Level<T>,
    /// A row rests while nothing in its stencil moves by more than this.
    rest: T,
    /// For a sheet: the full game, which it follows wherever that is safe.
    full: Option<&'a Level<T>>,
}

impl<T: Real> Kernel for Sweep<'_, T> {
    #[inline(always)]
    fn run(self) {
        let Self { level, rest, full } = self;
        let (ranges, bearings) = (level.range.nodes, level.bearings());
        // What matters flows from small ranges outwards most of the time.
        let inwards = level.sweeps % 8 == 7;
        let backwards = level.sweeps % 2 == 1;
        let n = level.angle_nodes;
        let (evader, pursuer) = (level.game.evader, level.game.pursuer);
        let follows =
            pursuer.turn_rate_radps < evader.turn_rate_radps || level.evader == Evader::Right;
        let mut scratch = vec![T::ZERO; 2 * n];
        let (buffer, floor) = scratch.split_at_mut(n);
        for i in 1..ranges {
            let i = if inwards { ranges - i } else { i };
            for k in 0..bearings {
                let k = if backwards { bearings - 1 - k } else { k };
                let change = if level.is_active(i, k, rest) {
                    let scratch = [&mut *buffer, &mut *floor];
                    if follows {
                        level.update::<true>(i, k, full, scratch)
                    } else {
                        level.update::<false>(i, k, full, scratch)
                    }
                } else {
                    T::ZERO
                };
                level.activity[i * bearings + k] = change;
            }
        }
        level.sweeps += 1;
    }
}

impl<T: Real> Level<T> {
    /// Whether anything in the stencil of a row has moved since.
    fn is_active(&self, i: usize, k: usize, rest: T) -> bool {
        let bearings = self.bearings();
        let moved = |i: usize, k: usize| self.activity[i * bearings + k] > rest;
        let near = |at: usize, end: usize| at.saturating_sub(PAD)..(at + PAD + 1).min(end);
        let wraps = self.evader == Evader::Right;
        near(i, self.range.nodes).any(|i| moved(i, k))
            || near(k, bearings).any(|k| moved(i, k))
            || wraps && k < PAD && (bearings + k - PAD..bearings).any(|k| moved(i, k))
            || wraps && k + PAD >= bearings && (0..=k + PAD - bearings).any(|k| moved(i, k))
    }

    /// Moves one row by its cells' own time steps; returns the largest change. `FOLLOWS`:
    /// the evader may copy the pursuer's turn without turning as fast as it can.
    #[inline(always)]
    fn update<const FOLLOWS: bool>(
        &mut self,
        i: usize,
        k: usize,
        full: Option<&Self>,
        [buffer, floor]: [&mut [T]; 2],
    ) -> T {
        let n = self.angle_nodes;
        let f = T::from_f64;
        let at = self.at(i, k);
        let (along, across) = (self.rows * self.row, self.row);
        let range_m = self.ranges[i];
        // Bearings and headings have the same nodes.
        let (sin_a, cos_a) = (self.sin[k], self.cos[k]);
        let (evader, pursuer) = (self.game.evader, self.game.pursuer);
        let (evader_speed, pursuer_speed) = (f(evader.speed_mps), f(pursuer.speed_mps));
        let (evader_ahead, evader_aside) = (evader_speed * cos_a, evader_speed * sin_a);
        let (ahead_cos, ahead_sin) = (pursuer_speed * cos_a, pursuer_speed * sin_a);
        let (evader_turn, pursuer_turn) = (f(evader.turn_rate_radps), f(pursuer.turn_rate_radps));
        let evader_left = if self.evader == Evader::Free { evader_turn } else { T::ZERO };
        // V is at least −R.
        let lowest = f(-range_m);
        let per_range = f(1.0 / range_m);
        let per_step = f(1.0 / ((range_m + self.range.knee_m) * self.range.step));
        let per_angle = f(n as f64 / TAU);
        let (zero, one, cfl) = (T::ZERO, f(1.0), f(CFL));

        let row = |offset: usize| &self.values[offset + PAD..][..n];
        let own = &self.values[at..][..n + 2 * PAD];
        let (own0, own1, own2, own3, own4) =
            (&own[..n], &own[1..][..n], &own[2..][..n], &own[3..][..n], &own[4..][..n]);
        let (in2, in1) = (row(at - 2 * along), row(at - along));
        let (out1, out2) = (row(at + along), row(at + 2 * along));
        let (right2, right1) = (row(at - 2 * across), row(at - across));
        let (left1, left2) = (row(at + across), row(at + 2 * across));
        let (sin, cos) = (&self.sin[..n], &self.cos[..n]);
        let (buffer, floor) = (&mut buffer[..n], &mut floor[..n]);
        let mut largest = zero;
        let (mut most, mut totals) = ([zero; LANES], [zero; LANES]);
        for j in 0..n {
            let w = own2[j];
            let (range_in, range_out) = one_sided(in2[j], in1[j], w, out1[j], out2[j]);
            let (bearing_in, bearing_out) = one_sided(right2[j], right1[j], w, left1[j], left2[j]);
            let (heading_in, heading_out) = one_sided(own0[j], own1[j], w, own3[j], own4[j]);
            let opening = ahead_cos * cos[j] + ahead_sin * sin[j] - evader_ahead;
            let slope = if opening > zero { range_out } else { range_in };
            let drift = (evader_aside + ahead_cos * sin[j] - ahead_sin * cos[j]) * per_range;
            let upwind = |speed: T, low: T, high: T| speed * if speed > zero { high } else { low };
            // Linear in a between its ends and where an angle stands still.
            let answer = |b: T| {
                let with = |a: T| {
                    upwind(drift - a, bearing_in, bearing_out)
                        + upwind(b - a, heading_in, heading_out)
                };
                let clip = |a: T| a.smaller(evader_turn).larger(-evader_left);
                with(evader_turn)
                    .larger(with(-evader_left))
                    .larger(with(clip(drift)))
                    .larger(if FOLLOWS { with(clip(b)) } else { with(evader_turn) })
            };
            let turning = answer(pursuer_turn).smaller(answer(-pursuer_turn));
            let rate = opening * (one + slope * per_step) + turning * per_angle;
            let speeds = opening.abs() * per_step
                + (drift.abs() + evader_turn + evader_turn + pursuer_turn) * per_angle;
            let moved = w + cfl * rate / speeds;
            // In this order NaN would survive, and be refused in the end.
            let moved = lowest.larger(zero.smaller(moved));
            buffer[j] = moved;
        }
        if let Some(full) = full {
            let safe = f(-SAFE * self.game.radius_m);
            full.copy_row(i, k, floor);
            for (new, floor) in buffer.iter_mut().zip(floor.iter()) {
                *new = if *floor > safe { new.larger(*floor) } else { *new };
            }
        }
        for (new, old) in buffer.chunks(LANES).zip(own2.chunks(LANES)) {
            match (new.first_chunk(), old.first_chunk()) {
                (Some(new), Some(old)) => tally(new, old, &mut most, &mut totals),
                _ => tally(&padded(new), &padded(old), &mut most, &mut totals),
            }
        }
        let bearings = self.bearings();
        let drift = &mut self.drift[i * bearings + k];
        for (most, total) in most.into_iter().zip(totals) {
            largest = largest.larger(most);
            *drift += total;
        }
        self.values[at + PAD..][..n].copy_from_slice(buffer);
        self.spread(i, k);
        largest
    }
}

/// Cells that fit the widest lanes, of single precision.
const LANES: usize = 16;

/// Adds what each lane moved to `totals`, and keeps the largest.
#[inline(always)]
fn tally<T: Real>(
    new: &[T; LANES],
    old: &[T; LANES],
    most: &mut [T; LANES],
    totals: &mut [T; LANES],
) {
    for lane in 0..LANES {
        let moved = new[lane] - old[lane];
        totals[lane] += moved;
        most[lane] = most[lane].larger(moved.abs());
    }
}

/// Fewer cells than lanes, and zeros.
fn padded<T: Real>(cells: &[T]) -> [T; LANES] {
    let mut lanes = [T::ZERO; LANES];
    lanes[..cells.len()].copy_from_slice(cells);
    lanes
}

/// Sweeps over a sheet.
const SHEET_SWEEPS: usize = 12;
/// A deficit of this share of the radius counts as none: the range need not close.
const SAFE: f64 = 1.0 / 3000.0;
/// The kink of the full game is blurred by at most this share of a cell: where the
/// sheets say less, the evader has something better than a single turn.
const KINK_BLUR: f64 = 0.2;
/// Sheets that differ by more than this many cells are no longer close to the kink.
const KINK_NEAR: f64 = 4.0;

/// Share of the stable step. From about 0.8 on, sweeps no longer settle.
const CFL: f64 = 0.6;

/// Left and right differences (not divided) at the middle one of five values: third
/// order where the data are smooth, like ENO2 where they are not.
#[inline(always)]
fn one_sided<T: Real>(a: T, b: T, c: T, d: T, e: T) -> (T, T) {
    let (d0, d1, d2, d3) = (b - a, c - b, d - c, e - d);
    let (low, middle, high) = (d1 - d0, d2 - d1, d3 - d2);
    let third = T::from_f64(1.0 / 3.0);
    let two = T::from_f64(2.0);
    // (outer + 2 inner)/3 is third order; never more than twice the smaller of both.
    let limited = |outer: T, inner: T| {
        let bound = two * if outer.abs() < inner.abs() { outer } else { inner };
        let wanted = (outer + two * inner) * third;
        if wanted.abs() > bound.abs() { bound } else { wanted }
    };
    (d1 + T::HALF * limited(low, middle), d2 - T::HALF * limited(high, middle))
}
