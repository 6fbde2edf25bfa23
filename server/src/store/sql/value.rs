//! Values of parameters.

use bytes::BytesMut;
use rusqlite::types::{ToSqlOutput, ValueRef};
use std::error::Error;
use tokio_postgres::types::{self, IsNull, Type};

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

impl Kind {
    /// PostgreSQL's name of it.
    pub(super) fn postgres(self) -> Type {
        match self {
            Self::Integer => Type::INT8,
            Self::Real => Type::FLOAT8,
            Self::Text => Type::TEXT,
            Self::Bytes => Type::BYTEA,
            Self::Truth => Type::BOOL,
        }
    }
}

/// A value.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(in crate::store) enum Value<'a> {
    /// NULL of a type.
    Null(Kind),
    /// A whole number.
    Integer(i64),
    /// A number.
    Real(f64),
    /// A text.
    Text(&'a str),
    /// Bytes.
    Bytes(&'a [u8]),
    /// True or false; SQLite stores 1 or 0.
    Truth(bool),
}

/// A value that keeps its text or bytes.
#[derive(Clone, Debug)]
pub(super) enum Owned {
    /// A text.
    Text(String),
    /// Bytes.
    Bytes(Vec<u8>),
    /// Anything else.
    Plain(Value<'static>),
}

impl Owned {
    /// The value again.
    pub(super) fn value(&self) -> Value<'_> {
        match self {
            Self::Text(text) => Value::Text(text),
            Self::Bytes(bytes) => Value::Bytes(bytes),
            Self::Plain(value) => *value,
        }
    }
}

impl Value<'_> {
    /// The same, kept.
    pub(super) fn owned(&self) -> Owned {
        match *self {
            Self::Null(kind) => Owned::Plain(Value::Null(kind)),
            Self::Integer(number) => Owned::Plain(Value::Integer(number)),
            Self::Real(number) => Owned::Plain(Value::Real(number)),
            Self::Truth(truth) => Owned::Plain(Value::Truth(truth)),
            Self::Text(text) => Owned::Text(text.to_owned()),
            Self::Bytes(bytes) => Owned::Bytes(bytes.to_owned()),
        }
    }

    /// Its type.
    pub(super) fn kind(&self) -> Kind {
        match self {
            Self::Null(kind) => *kind,
            Self::Integer(_) => Kind::Integer,
            Self::Real(_) => Kind::Real,
            Self::Text(_) => Kind::Text,
            Self::Bytes(_) => Kind::Bytes,
            Self::Truth(_) => Kind::Truth,
        }
    }
}

impl rusqlite::ToSql for Value<'_> {
    fn to_sql(&self) -> rusqlite::Result<ToSqlOutput<'_>> {
        Ok(ToSqlOutput::Borrowed(match *self {
            Self::Null(_) => ValueRef::Null,
            Self::Integer(number) => ValueRef::Integer(number),
            Self::Real(number) => ValueRef::Real(number),
            Self::Text(text) => ValueRef::Text(text.as_bytes()),
            Self::Bytes(bytes) => ValueRef::Blob(bytes),
            Self::Truth(truth) => ValueRef::Integer(truth.into()),
        }))
    }
}

impl types::ToSql for Value<'_> {
    fn to_sql(
        &self,
        to: &Type,
        out: &mut BytesMut,
    ) -> Result<IsNull, Box<dyn Error + Sync + Send>> {
        match self {
            Self::Null(_) => Ok(IsNull::Yes),
            Self::Integer(number) => number.to_sql(to, out),
            Self::Real(number) => number.to_sql(to, out),
            // PostgreSQL's texts have no NUL.
            Self::Text(text) if text.contains('\0') => {
                text.replace('\0', "\u{fffd}").to_sql(to, out)
            }
            Self::Text(text) => text.to_sql(to, out),
            Self::Bytes(bytes) => bytes.to_sql(to, out),
            Self::Truth(truth) => truth.to_sql(to, out),
        }
    }

    // Statements are prepared with the types of their values.
    fn accepts(_: &Type) -> bool {
        true
    }

    types::to_sql_checked!();
}

/// What can be a parameter.
pub(in crate::store) trait ToSql {
    /// Its value.
    fn value(&self) -> Value<'_>;
}

/// A type whose NULL has a type too.
pub(in crate::store) trait Typed {
    /// The type.
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
value!(Text: str, String => |text| Value::Text(text));
value!(Bytes: [u8], [u8; 32], Vec<u8> => |bytes| Value::Bytes(bytes));
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
