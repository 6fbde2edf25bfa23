//! Legends of charts.

use super::Colour;
use super::colours::{ACCENT, Ink, MUTED, SURFACE, TEXT};
use super::drawing::{Align, Drawing, Pen};
use super::layers::{Layer, Mark, Sign, Swarm};
use super::text::width_of;

/// A symbol and its meaning.
#[derive(Clone, Debug, PartialEq)]
pub struct LegendItem {
    /// The symbol, 26 px × 12 px.
    pub sign: Drawing,
    /// Its meaning.
    pub text: String,
}

/// Size of a symbol (px).
const SIGN: [f64; 2] = [26.0, 12.0];
/// Distances (px) from a symbol to its text, from the text to the next symbol, and between rows.
const GAP: f64 = 8.0;
const APART: f64 = 22.0;
const ROW: f64 = 24.0;
/// Font size (px).
const LETTERS: f64 = 12.0;

impl LegendItem {
    fn of(text: &str, draw: impl FnOnce(&mut Drawing)) -> Self {
        let mut sign = Drawing::new("", "", SIGN);
        draw(&mut sign);
        Self { sign, text: text.to_owned() }
    }

    /// A line, a mark or both.
    #[must_use]
    pub fn line(text: &str, line: Option<Pen>, mark: Option<(Mark, Ink)>) -> Self {
        Self::of(text, |sign| {
            if let Some(pen) = line {
                sign.line([[0.0, 6.0], [26.0, 6.0]], pen);
            }
            if let Some((mark, ink)) = mark {
                mark.draw(sign, [13.0, 6.0], 4.0, ink, Some(Pen::new(SURFACE, 1.0)));
            }
        })
    }

    /// A filled or outlined area.
    #[must_use]
    pub fn area(text: &str, fill: Option<Ink>, edge: Option<Pen>) -> Self {
        let corners = [[1.0, 0.0], [25.0, 0.0], [25.0, 12.0], [1.0, 12.0]];
        match fill {
            Some(_) => Self::of(text, |sign| sign.polygon(corners, fill, edge)),
            None => Self::line(text, edge, None),
        }
    }

    /// A region in its colour with its number.
    #[must_use]
    pub fn region(text: &str, number: usize, colour: Colour) -> Self {
        Self::of(text, |sign| {
            sign.polygon(
                [[2.0, -3.0], [24.0, -3.0], [24.0, 15.0], [2.0, 15.0]],
                Some(colour.into()),
                None,
            );
            Sign::Numeral(number).draw(sign, [13.0, 6.0], TEXT);
        })
    }

    /// A vehicle or an arrow.
    #[must_use]
    pub fn sign(text: &str, what: &Sign, colour: Colour) -> Self {
        Self::of(text, |sign| what.draw(sign, [13.0, 6.0], colour))
    }

    /// A small disc with an outline.
    #[must_use]
    pub fn disc(text: &str, fill: Option<Ink>, edge: Pen) -> Self {
        Self::of(text, |sign| sign.circle([13.0, 6.0], 7.0, fill, Some(edge)))
    }

    /// The legend of the named layers. Each name appears once.
    pub fn of_layers<'a>(layers: impl IntoIterator<Item = &'a Layer>) -> Vec<Self> {
        let mut items: Vec<Self> = Vec::new();
        for layer in layers {
            let of_layer = match layer {
                Layer::Series(of) => vec![Self::line(&of.name, of.line, of.mark)],
                Layer::Area(of) => vec![Self::area(&of.name, of.fill, of.edge)],
                Layer::Swarm(of) => Self::of_swarm(of),
                Layer::Cells(_) | Layer::Note(_) => vec![],
            };
            for item in of_layer {
                if !item.text.is_empty() && items.iter().all(|known| known.text != item.text) {
                    items.push(item);
                }
            }
        }
        items
    }

    fn of_swarm(of: &Swarm) -> Vec<Self> {
        let dot = Self::line(&of.name, None, Some((Mark::Circle, MUTED.at(0.55))));
        let centre = match of.interval {
            Some(interval) => {
                let (pen, mark) = (Pen::new(ACCENT, 2.5), (Mark::Diamond, ACCENT.into()));
                Self::line(&format!("{} and its {interval}", of.centre), Some(pen), Some(mark))
            }
            None => Self::line(of.centre, Some(Pen::new(TEXT, 2.5)), None),
        };
        vec![dot, centre]
    }
}

impl Drawing {
    /// Draws the items in one row if they fit `width` (px), otherwise in columns of equal width and
    /// in as few rows as possible. `[left, top]` is the left end of the first row, at half of the
    /// row's height. Returns the height of all rows (px).
    pub fn legend(&mut self, items: &[LegendItem], [left, top]: [f64; 2], width: f64) -> f64 {
        let lengths =
            items.iter().map(|item| SIGN[0] + GAP + width_of(&item.text, LETTERS, false) + APART);
        let lengths: Vec<f64> = lengths.collect();
        let column = lengths.iter().copied().fold(1.0, f64::max);
        let in_one_row = lengths.iter().sum::<f64>() <= width + APART;
        let most = if in_one_row { items.len() } else { ((width + APART) / column) as usize };
        let rows = items.len().div_ceil(most.max(1)).max(1);
        let columns = items.len().div_ceil(rows).max(1);
        for (i, item) in items.iter().enumerate() {
            let x = if in_one_row {
                left + lengths[..i].iter().sum::<f64>()
            } else {
                left + column * (i % columns) as f64
            };
            let y = top + ROW * (i / columns) as f64;
            self.place(&item.sign, [x, y - 0.5 * SIGN[1]]);
            self.text(&item.text, [x + SIGN[0] + GAP, y], LETTERS, TEXT, Align::Left);
        }
        ROW * rows as f64
    }
}
