//! Form input: the values of fields and of whole forms.

/// The value of one field.
#[derive(Clone, Debug, PartialEq)]
pub enum FieldValue {
    /// The text of a text field or text area, or the selected option of a list or of radio buttons.
    Text(String),
    /// The number in a number field or slider. `None` if the field contains no number.
    Number(Option<f64>),
    /// Whether a check box is ticked.
    Checked(bool),
    /// A pointer action on an element that listens to pointers.
    Pointing(Pointing),
}

/// A pointer action on an element, and its position.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Pointing {
    /// Position relative to the element's left and top edges, as fractions of its width and height.
    pub at: [f32; 2],
    /// The action.
    pub does: Does,
}

/// A pointer action.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Does {
    /// The pointer moves over the element while no button is down.
    #[default]
    Hover,
    /// A button or finger goes down.
    Press,
    /// The pointer moves while a button or finger is down. It can leave the element.
    Drag,
    /// The wheel turns by this many pixels. A positive number scrolls down.
    Roll(f32),
}

impl FieldValue {
    /// The text. Empty for other kinds of fields.
    #[must_use]
    pub fn text(&self) -> &str {
        match self {
            Self::Text(text) => text,
            _ => "",
        }
    }

    /// The number, if any.
    #[must_use]
    pub fn number(&self) -> Option<f64> {
        match self {
            Self::Number(number) => *number,
            _ => None,
        }
    }
}

/// The values of a form's fields by name. Fields without a name, disabled fields and groups of
/// radio buttons without a selection are absent.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Form(Vec<(String, FieldValue)>);

impl Form {
    /// Creates a form with these values.
    #[must_use]
    pub fn new(fields: Vec<(String, FieldValue)>) -> Self {
        Self(fields)
    }

    /// The value of a field.
    #[must_use]
    pub fn get(&self, name: &str) -> Option<&FieldValue> {
        self.0.iter().find(|(known, _)| known == name).map(|(_, value)| value)
    }

    /// The text of a field. Empty if the field is absent or of another kind.
    #[must_use]
    pub fn text(&self, name: &str) -> &str {
        self.get(name).map_or("", FieldValue::text)
    }

    /// The number in a field. `None` if the field contains no number or is absent.
    #[must_use]
    pub fn number(&self, name: &str) -> Option<f64> {
        self.get(name)?.number()
    }

    /// Whether a check box is ticked.
    #[must_use]
    pub fn is_checked(&self, name: &str) -> bool {
        matches!(self.get(name), Some(FieldValue::Checked(true)))
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
        ]);
        assert_eq!(form.text("title"), "Pilot");
        assert_eq!((form.number("speed"), form.number("empty")), (Some(2.5), None));
        assert_eq!((form.is_checked("agreed"), form.is_checked("absent")), (true, false));
        assert_eq!((form.text("speed"), form.number("title")), ("", None));
    }
}
