//! Colour scales: levels of a quantity, and the tones between them.

use crate::chart::{
    Align, Axis, Cells, Chart, Colour, Drawing, Frame, Pen, colours, fixed, round_step,
};
use crate::math::TAU;
use crate::picture::Window;
use crate::reachability::ValueFunction;

/// Colours of lines that are visible on every tone.
pub(super) const LIGHT: Colour = Colour::rgb([0xff, 0xff, 0xff]);
pub(super) const DARK: Colour = Colour::rgb([0x16, 0x10, 0x24]);

/// Maximum number of bands of a scale.
const MOST: usize = 13;

/// Ascending levels, with a tone for each band. There is a band below each level and a band above
/// the last level.
#[derive(Clone, Debug, PartialEq)]
pub struct Scale {
    /// The levels, each of which separates two tones.
    pub levels: Vec<f64>,
    /// The smallest and the largest value on the scale.
    pub ends: [f64; 2],
    /// Decimal places of the levels' numbers.
    pub places: usize,
    tones: [Colour; 5],
}

/// Blue, white and red for values below, at and above zero (after Brewer's RdBu).
const DIVERGING: [Colour; 5] = [
    Colour::rgb([0x21, 0x66, 0xac]),
    Colour::rgb([0x92, 0xc5, 0xde]),
    Colour::rgb([0xf7, 0xf7, 0xf7]),
    Colour::rgb([0xf4, 0xa5, 0x82]),
    Colour::rgb([0xb2, 0x18, 0x2b]),
];

impl Scale {
    /// A scale with round levels between `ends`, in tones of viridis.
    #[must_use]
    pub fn rising(ends: [f64; 2]) -> Self {
        let axis = Axis::linear("", "", ends, MOST - 1);
        let inner = axis.labels.iter().map(|(level, _)| *level);
        let levels: Vec<f64> = inner.filter(|level| ends[0] < *level && *level < ends[1]).collect();
        Self { places: places(&levels), levels, ends, tones: colours::SAFE_REGIONS }
    }

    /// The scale for V of a function over a window. It reaches from −R to the 90 % quantile of V
    /// over the window and all headings, but at least to R/2.
    #[must_use]
    pub fn of(function: &ValueFunction, window: Window) -> Self {
        const SIDE: u32 = 20;
        const HEADINGS: u32 = 8;
        let place = |d: usize, i: u32| {
            let share = (f64::from(i) + 0.5) / f64::from(SIDE);
            window.low[d] + share * (window.high[d] - window.low[d])
        };
        let nodes = (0..SIDE * SIDE * HEADINGS).map(|n| {
            let psi = f64::from(n / (SIDE * SIDE)) * TAU / f64::from(HEADINGS);
            function.value([place(0, n % SIDE), place(1, n / SIDE % SIDE), psi])
        });
        let mut values: Vec<f64> = nodes.collect();
        values.sort_by(f64::total_cmp);
        let most = values[values.len() * 9 / 10];
        let radius_m = function.game().radius_m;
        Self::rising([-radius_m, most.max(0.5 * radius_m)])
    }

    /// A scale from −`most` to `most` with round levels, white in the middle, blue below and red
    /// above.
    #[must_use]
    pub fn around_zero(most: f64) -> Self {
        let step = round_step(most.max(1e-9), 5);
        let bands = ((most / step).round() as i32).max(1);
        let levels: Vec<f64> = (-bands..bands).map(|i| (f64::from(i) + 0.5) * step).collect();
        let ends = [levels[0] - step, -levels[0] + step];
        Self { places: places(&levels), levels, ends, tones: DIVERGING }
    }

    /// Index of the band that contains a value; 0 below the first level.
    #[must_use]
    pub fn band(&self, value: f64) -> usize {
        self.levels.partition_point(|level| *level < value)
    }

    /// The tone of a band.
    #[must_use]
    pub fn tone(&self, band: usize) -> Colour {
        let last = self.tones.len() - 1;
        let at = last as f64 * band as f64 / self.levels.len().max(1) as f64;
        let from = (at as usize).min(last - 1);
        self.tones[from].towards(self.tones[from + 1], at - from as f64)
    }

    /// The lower and the upper limit of each band.
    fn limits(&self) -> impl Iterator<Item = [f64; 2]> + '_ {
        let low = [self.ends[0]].into_iter().chain(self.levels.iter().copied());
        let high = self.levels.iter().copied().chain([self.ends[1]]);
        low.zip(high).map(|(low, high)| [low, high])
    }

    /// Draws the tones with the levels' numbers beside them, and a line at zero.
    pub fn draw(&self, name: &str, drawing: &mut Drawing, frame: Frame) {
        let labels = self.levels.iter().map(|level| (*level, fixed(*level, self.places)));
        let y = Axis::ticked("", "", self.ends, labels.collect());
        let x = Axis::ticked("", "", [0.0, 1.0], Vec::new());
        let mut chart = Chart::new("", "", x, y);
        for (band, [low, high]) in self.limits().enumerate() {
            chart.add(Cells { ink: self.tone(band).into(), boxes: vec![[0.0, low, 1.0, high]] });
        }
        chart.draw(drawing, frame);
        // The name is right-aligned with the bar, because there is more room to the left.
        let at = [frame.left + frame.width, frame.top - 12.0];
        drawing.text(&format!("{name} (m)"), at, 11.5, colours::MUTED, Align::Right);
        if self.levels.contains(&0.0) {
            let [left, y] = chart.place(frame, [0.0, 0.0]);
            let line = [[left, y], [left + frame.width, y]];
            drawing.line(line, Pen::new(DARK, 4.0));
            drawing.line(line, Pen::new(LIGHT, 2.0));
        }
    }
}

/// The number of decimal places that the levels need.
fn places(levels: &[f64]) -> usize {
    let is_exact = |places: &usize| {
        let power = (0..*places).fold(1.0, |power, _| 10.0 * power);
        levels.iter().all(|level| (level * power - (level * power).round()).abs() < 1e-6)
    };
    (0..6).find(is_exact).unwrap_or(6)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn levels_are_round_and_within() {
        let scale = Scale::rising([-3.0, 14.2]);
        assert_eq!(scale.levels, [-2.0, 0.0, 2.0, 4.0, 6.0, 8.0, 10.0, 12.0, 14.0]);
        assert_eq!(
            (scale.band(-2.5), scale.band(0.0), scale.band(0.1), scale.band(99.0)),
            (0, 1, 2, 9)
        );
        assert_eq!(scale.tone(0).light, colours::SAFE_REGIONS[0].light);
        assert_eq!(scale.tone(9).light, colours::SAFE_REGIONS[4].light);
        assert_eq!(scale.places, 0);
        assert_eq!(Scale::rising([-0.3, 1.0]).places, 1);
    }

    #[test]
    fn errors_are_white_in_the_middle() {
        let scale = Scale::around_zero(0.043);
        assert_eq!(scale.tone(scale.band(0.0)).light, DIVERGING[2].light);
        assert_eq!(scale.tone(scale.band(0.043)).light, DIVERGING[4].light);
        assert_eq!(scale.tone(scale.band(-0.043)).light, DIVERGING[0].light);
        assert!(Scale::around_zero(0.0).ends[1] > 0.0);
    }
}
