//! Parameter values.

use sqlx::encode::Encode;
use sqlx::error::BoxDynError;
use sqlx::{Arguments, Database, Type};
use std::borrow::Cow;

/// The type of a value in PostgreSQL.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::store) enum Kind {
    /// BIGINT.
    Integer,
    /// DOUBLE PRECISION.
    Real,
    /// TEXT.
    Text,
    /// BYTEA.
    Bytes,
    /// BOOLEAN.
    Truth,
}

#[derive(Clone, Debug, PartialEq)]
pub(in crate::store) enum Value<'a> {
    /// NULL, with its type.
    Null(Kind),
    /// An integer.
    Integer(i64),
    /// A number.
    Real(f64),
    /// A text.
    Text(Cow<'a, str>),
    /// Bytes.
    Bytes(Cow<'a, [u8]>),
    /// A Boolean, which SQLite stores as 1 or 0.
    Truth(bool),
}

impl Value<'_> {
    /// Replaces NUL characters, because PostgreSQL's texts cannot contain them.
    pub(super) fn without_nul(&self) -> Value<'_> {
        match self.value() {
            Value::Text(text) if text.contains('\0') => {
                Value::Text(text.replace('\0', "\u{fffd}").into())
            }
            other => other,
        }
    }

    /// Converts to a value that owns its text or bytes.
    pub(in crate::store) fn into_owned(self) -> Value<'static> {
        match self {
            Self::Null(kind) => Value::Null(kind),
            Self::Integer(number) => Value::Integer(number),
            Self::Real(number) => Value::Real(number),
            Self::Text(text) => Value::Text(text.into_owned().into()),
            Self::Bytes(bytes) => Value::Bytes(bytes.into_owned().into()),
            Self::Truth(truth) => Value::Truth(truth),
        }
    }
}

/// A Rust type that a database accepts as a parameter.
pub(super) trait Plain<DB: Database>: for<'q> Encode<'q, DB> + Type<DB> {}
impl<DB: Database, T: for<'q> Encode<'q, DB> + Type<DB>> Plain<DB> for T {}

/// The values as arguments for sqlx.
pub(super) fn arguments<DB: Database>(values: &[Value<'_>]) -> Result<DB::Arguments, sqlx::Error>
where
    i64: Plain<DB>,
    f64: Plain<DB>,
    bool: Plain<DB>,
    String: Plain<DB>,
    Vec<u8>: Plain<DB>,
    Option<i64>: Plain<DB>,
    Option<f64>: Plain<DB>,
    Option<bool>: Plain<DB>,
    Option<String>: Plain<DB>,
    Option<Vec<u8>>: Plain<DB>,
{
    let mut arguments = DB::Arguments::default();
    let mut add = |value: &Value<'_>| -> Result<(), BoxDynError> {
        match value {
            Value::Null(Kind::Integer) => arguments.add(None::<i64>),
            Value::Null(Kind::Real) => arguments.add(None::<f64>),
            Value::Null(Kind::Text) => arguments.add(None::<String>),
            Value::Null(Kind::Bytes) => arguments.add(None::<Vec<u8>>),
            Value::Null(Kind::Truth) => arguments.add(None::<bool>),
            Value::Integer(number) => arguments.add(*number),
            Value::Real(number) => arguments.add(*number),
            Value::Text(text) => arguments.add(text.clone().into_owned()),
            Value::Bytes(bytes) => arguments.add(bytes.clone().into_owned()),
            Value::Truth(truth) => arguments.add(*truth),
        }
    };
    values.iter().try_for_each(&mut add).map_err(sqlx::Error::Encode)?;
    Ok(arguments)
}

/// A type that can be a parameter.
pub(in crate::store) trait ToSql {
    fn value(&self) -> Value<'_>;
}

impl ToSql for Value<'_> {
    fn value(&self) -> Value<'_> {
        match self {
            Self::Text(text) => Value::Text(Cow::Borrowed(text)),
            Self::Bytes(bytes) => Value::Bytes(Cow::Borrowed(bytes)),
            other => other.clone(),
        }
    }
}

/// A Rust type that determines the type of a NULL in PostgreSQL.
pub(in crate::store) trait Typed {
    const KIND: Kind;
}

macro_rules! value {
    ($kind:ident: $($type:ty),* => $value:expr) => {$(
        impl Typed for $type {
            const KIND: Kind = Kind::$kind;
        }
        impl ToSql for $type {
            fn value(&self) -> Value<'_> {
                let make: fn(&$type) -> Value<'_> = $value;
                make(self)
            }
        }
    )*};
}

value!(Integer: i64 => |number| Value::Integer(*number));
value!(Integer: i32, u32, u8 => |number| Value::Integer(i64::from(*number)));
value!(Real: f64 => |number| Value::Real(*number));
value!(Text: str, String => |text| Value::Text(Cow::Borrowed(text)));
value!(Bytes: [u8], [u8; 32], Vec<u8> => |bytes| Value::Bytes(Cow::Borrowed(bytes)));
value!(Truth: bool => |truth| Value::Truth(*truth));

impl<T: Typed + ?Sized> Typed for &T {
    const KIND: Kind = T::KIND;
}

impl<T: ToSql + ?Sized> ToSql for &T {
    fn value(&self) -> Value<'_> {
        (**self).value()
    }
}

impl<T: ToSql + Typed> ToSql for Option<T> {
    fn value(&self) -> Value<'_> {
        self.as_ref().map_or(Value::Null(T::KIND), ToSql::value)
    }
}
