//! Fast formatting of numbers.

use std::io::Write;

/// Appends the shortest decimal that parses to the same bits, in the form of `{:?}`, such as `4.0` or
/// `1e16`. If two such decimals are equally near, the one with the even last digit is chosen.
pub(super) fn number(out: &mut Vec<u8>, number: f64) {
    // Outside this range, `{:?}` writes exponents, and no faster library writes the same text.
    if (1e-4..1e16).contains(&number.abs()) || number == 0.0 {
        out.extend_from_slice(zmij::Buffer::new().format_finite(number).as_bytes());
    } else {
        write!(out, "{number:?}").unwrap_or_default();
    }
}

/// Appends the shortest decimal that parses to the same bits, in the form of `{}`. A whole number
/// has no decimal point, such as `4`, and there is never an exponent.
pub(super) fn time(out: &mut Vec<u8>, ms: f64) {
    if (1e-4..1e16).contains(&ms.abs()) || ms == 0.0 {
        let mut buffer = zmij::Buffer::new();
        let text = buffer.format_finite(ms);
        out.extend_from_slice(text.strip_suffix(".0").unwrap_or(text).as_bytes());
    } else {
        write!(out, "{ms}").unwrap_or_default();
    }
}

/// Appends a whole number.
pub(super) fn whole(out: &mut Vec<u8>, number: i64) {
    out.extend_from_slice(itoa::Buffer::new().format(number).as_bytes());
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn same(value: f64) {
        let text = |print: fn(&mut Vec<u8>, f64)| {
            let mut out = Vec::new();
            print(&mut out, value);
            String::from_utf8(out).unwrap()
        };
        for (text, standard) in
            [(text(number), format!("{value:?}")), (text(time), format!("{value}"))]
        {
            if text != standard {
                // If two decimals are equally near, the standard library does not choose the even one.
                let is_tie = (value.abs().fract() * 20.0) % 2.0 == 1.0;
                assert!(is_tie && text.len() == standard.len(), "{text}, {standard}");
                let read: f64 = text.parse().unwrap();
                assert_eq!(read.to_bits(), value.to_bits(), "{text}");
            }
        }
    }

    #[test]
    fn ends_of_the_ranges_and_odd_numbers() {
        for edge in [1e-4, 1e16, 1e-5, 1e15, 1e17, 0.0, 5e-324, f64::MIN_POSITIVE, f64::MAX, 4.0] {
            for value in [edge, edge.next_up(), edge.next_down()] {
                same(value);
                same(-value);
            }
        }
        same(-721_818_359_108_790.0 - 0.25);
        for value in [0.1 + 0.2, 1_760_000_000_123.25, 9_007_199_254_740_993.0, 123_456.0, 1.5e300]
        {
            same(value);
        }
    }

    proptest! {
        #[test]
        fn every_number_in_the_form_of_the_standard_library(
            value in prop::num::f64::ANY, decimals in -1_000_000_000_i64..1_000_000_000,
        ) {
            same(value);
            same(decimals as f64 / 1e4);
        }
    }
}
