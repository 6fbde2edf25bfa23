//! The lower envelope of curves x(y): at each y the smallest x.

use nalgebra::Complex;

/// Two values of y that differ by less than this (s) count as equal.
const LEVEL: f64 = 1e-11;

/// The lower envelope of the curves added so far.
#[derive(Clone, Debug, Default)]
pub(super) struct Envelope {
    /// The current envelope. Its y is non-decreasing.
    base: Vec<Complex<f64>>,
    /// Buffer for the next envelope.
    next: Vec<Complex<f64>>,
    /// A part of a curve along which y is monotonic.
    run: Vec<Complex<f64>>,
}

impl Envelope {
    pub(super) fn clear(&mut self) {
        self.base.clear();
    }

    /// The points, ordered by y.
    pub(super) fn points(&self) -> &[Complex<f64>] {
        &self.base
    }

    /// Removes points whose two neighbours have the same y, up to rounding errors. Otherwise, the
    /// envelope would zigzag where one curve ends and another begins.
    pub(super) fn straighten(&mut self) {
        let level = |three: &[Complex<f64>]| three[2].im - three[0].im < LEVEL;
        self.next.clear();
        self.next.extend(self.base.first());
        let inner = self.base.windows(3).filter(|three| !level(three)).map(|three| three[1]);
        self.next.extend(inner);
        self.next.extend(self.base.last().filter(|_| self.base.len() > 1));
        core::mem::swap(&mut self.base, &mut self.next);
    }

    /// Adds a curve. The first curve defines the range of y, and its y must be non-decreasing. Every
    /// later curve is split into parts with monotonic y, and these parts count only within this range.
    /// Consecutive points of a curve must differ by more than rounding errors.
    pub(super) fn add(&mut self, curve: impl Iterator<Item = Complex<f64>>) {
        if self.base.is_empty() {
            self.base.extend(curve);
            return;
        }
        self.run.clear();
        // The last change of y, or 0 at the beginning.
        let mut slope = 0.0;
        for point in curve {
            if let Some(&last) = self.run.last() {
                let rise = point.im - last.im;
                if rise == 0.0 || (slope != 0.0 && (rise > 0.0) != (slope > 0.0)) {
                    self.add_run();
                    self.run.clear();
                    self.run.extend((rise != 0.0).then_some(last));
                }
                slope = rise;
            }
            self.run.push(point);
        }
        self.add_run();
    }

    fn add_run(&mut self) {
        let [first, .., last] = self.run[..] else {
            return;
        };
        if first.im > last.im {
            self.run.reverse();
        }
        if !reaches_below(&self.base, &self.run) {
            return;
        }
        self.next.clear();
        merge(&self.base, &self.run, &mut self.next);
        core::mem::swap(&mut self.base, &mut self.next);
    }
}

/// Whether `run` is below `base` at any vertex of the two curves. Most runs are not, and need not be
/// merged.
fn reaches_below(base: &[Complex<f64>], run: &[Complex<f64>]) -> bool {
    let (low, high) = (run[0].im, run[run.len() - 1].im);
    let first = base.partition_point(|point| point.im < low);
    let mut next = first;
    let on_run = run.iter().any(|point| {
        while next < base.len() && base[next].im < point.im {
            next += 1;
        }
        let at = next < base.len() && base[next].im == point.im;
        value(base, next, at, point.im).is_some_and(|x| point.re < x)
    });
    let mut next = 0;
    on_run
        || base[first..].iter().take_while(|point| point.im <= high).any(|point| {
            while run[next].im < point.im {
                next += 1;
            }
            let at = run[next].im == point.im;
            value(run, next, at, point.im).is_some_and(|x| x < point.re)
        })
}

/// Writes the lower envelope of `base` and `run` to `merged`. In both, y must be non-decreasing.
fn merge(base: &[Complex<f64>], run: &[Complex<f64>], merged: &mut Vec<Complex<f64>>) {
    let (low, high) = (run[0].im, run[run.len() - 1].im);
    let (mut b, mut r) = (0, 0);
    // The last y at which both curves are defined, and x of `run` minus x of `base` there.
    let mut previous: Option<(f64, f64)> = None;
    while b < base.len() {
        let y = if r < run.len() { base[b].im.min(run[r].im) } else { base[b].im };
        let on_base = base[b].im == y;
        let on_run = r < run.len() && run[r].im == y;
        let from_base = value(base, b, on_base, y);
        let gap = match from_base {
            Some(x) if low <= y && y <= high => value(run, r, on_run, y).map(|other| other - x),
            _ => None,
        };
        if let (Some((last_y, last_gap)), Some(gap)) = (previous, gap)
            && (last_gap < 0.0) != (gap < 0.0)
            && last_y < y
        {
            let share = last_gap / (last_gap - gap);
            let crossing = last_y + (y - last_y) * share;
            if let Some(x) = value(base, b, false, crossing) {
                merged.push(Complex::new(x, crossing));
            }
        }
        match (from_base, gap) {
            (Some(x), Some(gap)) if gap < 0.0 => {
                // Where `run` begins or ends below `base`, the envelope jumps.
                if previous.is_none() {
                    merged.push(Complex::new(x, y));
                }
                merged.push(Complex::new(x + gap, y));
                if y == high {
                    merged.push(Complex::new(x, y));
                }
            }
            (Some(x), _) if on_base => merged.push(Complex::new(x, y)),
            _ => {}
        }
        previous = gap.map(|gap| (y, gap));
        b += usize::from(on_base);
        r += usize::from(on_run);
    }
}

/// The x of a curve at `y`: at the vertex `next` if `at` is true, otherwise on the edge before this
/// vertex.
fn value(curve: &[Complex<f64>], next: usize, at: bool, y: f64) -> Option<f64> {
    if at {
        return Some(curve[next].re);
    }
    let (a, b) = (curve.get(next.checked_sub(1)?)?, curve.get(next)?);
    Some(a.re + (b.re - a.re) * ((y - a.im) / (b.im - a.im)))
}
