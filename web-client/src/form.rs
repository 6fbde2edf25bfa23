//! What people entered: the values of fields, and of whole forms.

/// The value of one field.
#[derive(Clone, Debug, PartialEq)]
pub enum FieldValue {
    /// Text of a text field or text area, or the chosen entry of a list or of radio buttons.
    Text(String),
    /// A number field or slider; nothing if it holds no number.
    Number(Option<f64>),
    /// Whether a check box is ticked.
    Checked(bool),
    /// The chosen entries of a list that allows several.
    Choices(Vec<String>),
}

impl FieldValue {
    /// The text; empty for another kind of field.
    #[must_use]
    pub fn text(&self) -> &str {
        match self {
            Self::Text(text) => text,
            _ => "",
        }
    }

    /// The number, if there is one.
    #[must_use]
    pub fn number(&self) -> Option<f64> {
        match self {
            Self::Number(number) => *number,
            _ => None,
        }
    }
}

/// The values of a form's fields by name. Fields without a name, disabled fields and groups of
/// radio buttons without a choice are absent.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Form(Vec<(String, FieldValue)>);

impl Form {
    /// A form with these values.
    #[must_use]
    pub fn new(fields: Vec<(String, FieldValue)>) -> Self {
        Self(fields)
    }

    /// The value of a field.
    #[must_use]
    pub fn get(&self, name: &str) -> Option<&FieldValue> {
        self.0.iter().find(|(known, _)| known == name).map(|(_, value)| value)
    }

    /// The text of a field; empty if it is absent or of another kind.
    #[must_use]
    pub fn text(&self, name: &str) -> &str {
        self.get(name).map_or("", FieldValue::text)
    }

    /// The number in a field; nothing if it holds none or is absent.
    #[must_use]
    pub fn number(&self, name: &str) -> Option<f64> {
        self.get(name)?.number()
    }

    /// Whether a check box is ticked.
    #[must_use]
    pub fn is_checked(&self, name: &str) -> bool {
        matches!(self.get(name), Some(FieldValue::Checked(true)))
    }

    /// The chosen entries of a list; empty if the field is absent or of another kind.
    #[must_use]
    pub fn choices(&self, name: &str) -> &[String] {
        match self.get(name) {
            Some(FieldValue::Choices(choices)) => choices,
            _ => &[],
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fields_are_read_by_name_and_kind() {
        let form = Form::new(vec![
            ("title".into(), FieldValue::Text("Pilot".into())),
            ("speed".into(), FieldValue::Number(Some(2.5))),
            ("empty".into(), FieldValue::Number(None)),
            ("agreed".into(), FieldValue::Checked(true)),
            ("models".into(), FieldValue::Choices(vec!["svm".into(), "lr".into()])),
        ]);
        assert_eq!(form.text("title"), "Pilot");
        assert_eq!((form.number("speed"), form.number("empty")), (Some(2.5), None));
        assert_eq!((form.is_checked("agreed"), form.is_checked("absent")), (true, false));
        assert_eq!(form.choices("models"), ["svm", "lr"]);
        assert_eq!((form.text("speed"), form.number("title")), ("", None));
        assert!(form.choices("absent").is_empty());
    }
}
