//! Tables and numbers as a page shows them.

/// The head of a table; the first columns are words, the others numbers.
pub(super) fn head(titles: &str, words: usize) -> String {
    let columns = titles.split(" | ").count();
    let rules: Vec<_> = (0..columns).map(|i| if i < words { "---" } else { "---:" }).collect();
    format!("| {titles} |\n|{}|", rules.join("|"))
}

/// Metres in centimetres, to two or three digits.
pub(super) fn cm(metres: f64) -> String {
    let cm = 100.0 * metres;
    if cm.abs() < 1.0 { format!("{cm:.2}") } else { format!("{cm:.1}") }
}

/// A duration, to so many places as its size deserves.
pub(super) fn seconds(seconds: f64) -> String {
    let places = match seconds {
        ..1.0 => 3,
        ..10.0 => 1,
        _ => 0,
    };
    format!("{seconds:.places$}")
}

/// 1234567 as 1,234,567.
pub(super) fn thousands(number: usize) -> String {
    let digits = number.to_string();
    let mut text = String::new();
    for (i, digit) in digits.chars().enumerate() {
        if i > 0 && (digits.len() - i).is_multiple_of(3) {
            text.push(',');
        }
        text.push(digit);
    }
    text
}

/// A number ≥ 0 as 1.2·10⁻³.
pub(super) fn power(number: f64) -> String {
    if number == 0.0 {
        return "0".to_owned();
    }
    let text = format!("{number:.1e}");
    let (digits, exponent) = text.split_once('e').unwrap_or((&text, "0"));
    let raised = |digit: char| match digit {
        '-' => '⁻',
        '1' => '¹',
        '2' => '²',
        '3' => '³',
        digit => digit.to_digit(10).and_then(|d| char::from_u32('⁰' as u32 + d)).unwrap_or(digit),
    };
    format!("{digits}·10{}", exponent.chars().map(raised).collect::<String>())
}

/// With the sign that readers expect.
pub(super) fn minus(text: String) -> String {
    text.replace('-', "−")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_written_for_readers() {
        assert_eq!(power(3.4e-8), "3.4·10⁻⁸");
        assert_eq!(power(1.23e10), "1.2·10¹⁰");
        assert_eq!(power(0.0), "0");
        assert_eq!(thousands(1_234_567), "1,234,567");
        assert_eq!(thousands(999), "999");
        assert_eq!([cm(0.0154), cm(0.00049)], ["1.5", "0.05"]);
        assert_eq!([seconds(0.096), seconds(9.6), seconds(191.5)], ["0.096", "9.6", "192"]);
        assert_eq!(minus("-0.42".into()), "−0.42");
    }

    #[test]
    fn a_table_has_a_rule_for_every_column() {
        assert_eq!(head("game | error, m", 1), "| game | error, m |\n|---|---:|");
    }
}
