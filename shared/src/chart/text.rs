//! Approximate widths of text.

/// Advance widths of DejaVu Sans from space to tilde, in hundredths of the font size.
const ADVANCES: [u8; 95] = [
    32, 40, 46, 84, 64, 95, 78, 27, 39, 39, 50, 84, 32, 36, 32, 34, 64, 64, 64, 64, 64, 64, 64, 64,
    64, 64, 34, 34, 84, 84, 84, 53, 100, 68, 69, 70, 77, 63, 58, 77, 75, 29, 29, 66, 56, 86, 75,
    79, 60, 79, 69, 63, 61, 73, 68, 99, 69, 61, 69, 39, 34, 39, 84, 50, 50, 61, 63, 55, 63, 62, 35,
    63, 63, 28, 28, 58, 28, 97, 63, 61, 63, 63, 41, 52, 39, 63, 59, 82, 59, 59, 52, 64, 34, 64, 84,
];

/// The digits of a number as subscripts, as in F₁₀.
#[must_use]
pub fn lowered(number: usize) -> String {
    let low = |digit: char| digit.to_digit(10).and_then(|digit| char::from_u32(0x2080 + digit));
    number.to_string().chars().filter_map(low).collect()
}

/// The width of a line of text (px) in the widest font used (DejaVu Sans).
#[must_use]
pub fn width_of(text: &str, size: f64, bold: bool) -> f64 {
    let advance = |c: char| {
        let place = (c as usize).checked_sub(0x20).and_then(|place| ADVANCES.get(place));
        f64::from(place.copied().unwrap_or(65))
    };
    let hundredths: f64 = text.chars().map(advance).sum();
    0.01 * size * hundredths * if bold { 1.12 } else { 1.0 }
}
