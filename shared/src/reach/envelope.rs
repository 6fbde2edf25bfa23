//! The lower envelope of curves x(y): at each y the smallest x.

use nalgebra::Complex;

/// The smaller of `base`, whose y never falls, and each stretch of `curve`,
/// within the range of `base`. Neither may hold points that differ by rounding
/// errors only. An empty `base` stands for nothing yet: then the
/// answer is `curve`.
pub(super) fn lower_envelope(base: Vec<Complex<f64>>, curve: &[Complex<f64>]) -> Vec<Complex<f64>> {
    if base.is_empty() {
        return curve.to_vec();
    }
    runs(curve).fold(base, |base, run| merge(&base, &run))
}

/// The stretches of a curve along which y strictly rises, or falls (turned round).
fn runs(curve: &[Complex<f64>]) -> impl Iterator<Item = Vec<Complex<f64>>> + '_ {
    let mut first = 0;
    core::iter::from_fn(move || {
        while first + 1 < curve.len() && curve[first].im == curve[first + 1].im {
            first += 1;
        }
        if first + 1 >= curve.len() {
            return None;
        }
        let rises = curve[first + 1].im > curve[first].im;
        let mut last = first + 1;
        while last + 1 < curve.len()
            && curve[last + 1].im != curve[last].im
            && (curve[last + 1].im > curve[last].im) == rises
        {
            last += 1;
        }
        let mut run = curve[first..=last].to_vec();
        if !rises {
            run.reverse();
        }
        first = last;
        Some(run)
    })
}

/// The smaller of `base` and `run`, where `run` is defined; y rises in both.
fn merge(base: &[Complex<f64>], run: &[Complex<f64>]) -> Vec<Complex<f64>> {
    let (low, high) = (run[0].im, run[run.len() - 1].im);
    let mut merged: Vec<Complex<f64>> = Vec::with_capacity(base.len() + run.len());
    let (mut b, mut r) = (0, 0);
    // Whether `run` was below at the last height, and by how much.
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
                // Where `run` begins or ends below, the envelope jumps.
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
    merged
}

/// x of a curve at height `y`: at its vertex `next`, or on the edge before it.
fn value(curve: &[Complex<f64>], next: usize, at: bool, y: f64) -> Option<f64> {
    if at {
        return Some(curve[next].re);
    }
    let (a, b) = (curve.get(next.checked_sub(1)?)?, curve.get(next)?);
    Some(a.re + (b.re - a.re) * ((y - a.im) / (b.im - a.im)))
}
