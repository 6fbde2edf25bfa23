//! Training data: rows of features, each with its class.

use crate::invalid::{Invalid, finite, length};

/// Rows of finite numbers, each with one of the classes 0 … `classes` − 1.
#[derive(Clone, Copy, Debug)]
pub struct Samples<'a> {
    width: usize,
    values: &'a [f64],
    labels: &'a [usize],
    classes: usize,
}

impl<'a> Samples<'a> {
    /// Rows of `width` columns (row-major) and the class of each row.
    ///
    /// # Errors
    /// [`Invalid`] if there are no columns, rows or classes, if lengths do not match, if a number
    /// is not finite, or if a label is not below `classes`.
    pub fn new(
        width: usize,
        values: &'a [f64],
        labels: &'a [usize],
        classes: usize,
    ) -> Result<Self, Invalid> {
        for (field, count) in [("width", width), ("labels", labels.len()), ("classes", classes)] {
            if count == 0 {
                return Err(Invalid::new(field, "at least 1", "0"));
            }
        }
        length("rows", width * labels.len(), values.len())?;
        if let Some(i) = values.iter().position(|value| !value.is_finite()) {
            finite(&format!("rows[{}][{}]", i / width, i % width), values[i])?;
        }
        if let Some(i) = labels.iter().position(|&label| label >= classes) {
            let expected = format!("a class from 0 to {}", classes - 1);
            return Err(Invalid::new(format!("labels[{i}]"), expected, labels[i]));
        }
        Ok(Self { width, values, labels, classes })
    }

    /// The number of columns.
    #[must_use]
    pub fn width(&self) -> usize {
        self.width
    }

    /// The number of classes, including classes that do not occur.
    #[must_use]
    pub fn classes(&self) -> usize {
        self.classes
    }

    /// The class of each row.
    #[must_use]
    pub fn labels(&self) -> &'a [usize] {
        self.labels
    }

    /// The rows in order.
    pub fn rows(&self) -> std::slice::ChunksExact<'a, f64> {
        self.values.chunks_exact(self.width)
    }

    /// The number of rows of each class.
    #[must_use]
    pub fn counts(&self) -> Vec<usize> {
        let mut counts = vec![0; self.classes];
        for &label in self.labels {
            counts[label] += 1;
        }
        counts
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn complaints_name_the_field() {
        let complain = |width, values: &[f64], labels: &[usize], classes| {
            Samples::new(width, values, labels, classes).unwrap_err().field
        };
        assert_eq!(complain(0, &[], &[0], 1), "width");
        assert_eq!(complain(1, &[], &[], 1), "labels");
        assert_eq!(complain(1, &[1.0], &[0], 0), "classes");
        assert_eq!(complain(2, &[1.0], &[0], 1), "rows");
        assert_eq!(complain(2, &[1.0, 2.0, 3.0, f64::NAN], &[0, 0], 1), "rows[1][1]");
        assert_eq!(complain(1, &[1.0, f64::INFINITY], &[0, 0], 1), "rows[1][0]");
        assert_eq!(complain(1, &[1.0, 2.0], &[0, 2], 2), "labels[1]");
    }

    #[test]
    fn classes_are_counted() {
        let samples = Samples::new(1, &[1.0, 2.0, 3.0], &[2, 0, 2], 4).unwrap();
        assert_eq!(samples.counts(), [1, 0, 2, 0]);
    }
}
