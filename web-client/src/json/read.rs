//! From text to a tree, and from the tree to a type.

use serde::de::value::{MapDeserializer, SeqDeserializer};
use serde::de::{Deserializer, IntoDeserializer, Visitor};
use serde::forward_to_deserialize_any;
use std::fmt;

/// A JSON value.
#[derive(Clone)]
pub(super) enum Json {
    Null,
    Bool(bool),
    Number(f64),
    Text(String),
    List(Vec<Json>),
    /// Values by name.
    Object(Vec<(String, Json)>),
}

/// A value is not of the wanted shape. It says no more: the code that formats messages which
/// nobody sees would be a good part of what is saved here.
#[derive(Debug)]
pub(super) struct Unfit;

impl fmt::Display for Unfit {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("not of the wanted shape")
    }
}

impl std::error::Error for Unfit {}

impl serde::ser::Error for Unfit {
    fn custom<T: fmt::Display>(_: T) -> Self {
        Self
    }
}

impl serde::de::Error for Unfit {
    fn custom<T: fmt::Display>(_: T) -> Self {
        Self
    }

    fn invalid_type(_: serde::de::Unexpected<'_>, _: &dyn serde::de::Expected) -> Self {
        Self
    }

    fn invalid_value(_: serde::de::Unexpected<'_>, _: &dyn serde::de::Expected) -> Self {
        Self
    }
}

/// The tree of a text, by the browser.
#[cfg(target_arch = "wasm32")]
pub(super) fn parse(text: &[u8]) -> Option<Json> {
    let value = js_sys::JSON::parse(std::str::from_utf8(text).ok()?).ok()?;
    Some(tree(&value))
}

#[cfg(target_arch = "wasm32")]
fn tree(value: &wasm_bindgen::JsValue) -> Json {
    use wasm_bindgen::JsCast;
    if let Some(number) = value.as_f64() {
        Json::Number(number)
    } else if let Some(text) = value.as_string() {
        Json::Text(text)
    } else if let Some(flag) = value.as_bool() {
        Json::Bool(flag)
    } else if let Some(list) = value.dyn_ref::<js_sys::Array>() {
        Json::List(list.iter().map(|entry| tree(&entry)).collect())
    } else if let Some(object) = value.dyn_ref::<js_sys::Object>() {
        let entry = |pair: wasm_bindgen::JsValue| {
            let pair: js_sys::Array = pair.unchecked_into();
            (pair.get(0).as_string().unwrap_or_default(), tree(&pair.get(1)))
        };
        Json::Object(js_sys::Object::entries(object).iter().map(entry).collect())
    } else {
        Json::Null
    }
}

/// The tree of a text, where there is no browser.
#[cfg(not(target_arch = "wasm32"))]
pub(super) fn parse(text: &[u8]) -> Option<Json> {
    fn tree(value: serde_json::Value) -> Json {
        match value {
            serde_json::Value::Null => Json::Null,
            serde_json::Value::Bool(flag) => Json::Bool(flag),
            serde_json::Value::Number(number) => Json::Number(number.as_f64().unwrap_or(f64::NAN)),
            serde_json::Value::String(text) => Json::Text(text),
            serde_json::Value::Array(list) => Json::List(list.into_iter().map(tree).collect()),
            serde_json::Value::Object(object) => {
                Json::Object(object.into_iter().map(|(name, value)| (name, tree(value))).collect())
            }
        }
    }
    serde_json::from_slice(text).ok().map(tree)
}

impl IntoDeserializer<'_, Unfit> for Json {
    type Deserializer = Self;

    fn into_deserializer(self) -> Self {
        self
    }
}

/// Largest size of a whole number that a double holds exactly.
const WHOLE: f64 = 9_007_199_254_740_992.0;

macro_rules! same {
    ($($($method:ident)* => $other:ident;)*) => {$($(
        fn $method<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Unfit> {
            self.$other(visitor)
        }
    )*)*};
}

/// A type that says what it is made of is read from that alone: the compiler leaves out how it
/// would be read from something else, which is much of the program.
impl<'de> Deserializer<'de> for Json {
    type Error = Unfit;

    fn deserialize_any<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Unfit> {
        match self {
            Self::Null => visitor.visit_unit(),
            Self::Bool(flag) => visitor.visit_bool(flag),
            // Visitors of whole numbers take no others, and those of others take both.
            Self::Number(n)
                if n as i64 as f64 == n
                    && n.abs() <= WHOLE
                    && n.to_bits() != (-0.0f64).to_bits() =>
            {
                visitor.visit_i64(n as i64)
            }
            Self::Number(n) => visitor.visit_f64(n),
            Self::Text(text) => visitor.visit_string(text),
            Self::List(list) => {
                let mut rest = SeqDeserializer::new(list.into_iter());
                let value = visitor.visit_seq(&mut rest)?;
                rest.end()?;
                Ok(value)
            }
            Self::Object(object) => visitor.visit_map(MapDeserializer::new(object.into_iter())),
        }
    }

    fn deserialize_bool<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Unfit> {
        match self {
            Self::Bool(flag) => visitor.visit_bool(flag),
            _ => Err(Unfit),
        }
    }

    fn deserialize_f64<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Unfit> {
        match self {
            Self::Number(number) => visitor.visit_f64(number),
            _ => Err(Unfit),
        }
    }

    fn deserialize_i64<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Unfit> {
        match self {
            Self::Number(number) if number as i64 as f64 == number && number.abs() <= WHOLE => {
                visitor.visit_i64(number as i64)
            }
            _ => Err(Unfit),
        }
    }

    fn deserialize_string<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Unfit> {
        match self {
            Self::Text(text) => visitor.visit_string(text),
            _ => Err(Unfit),
        }
    }

    fn deserialize_seq<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Unfit> {
        let Self::List(list) = self else { return Err(Unfit) };
        let mut rest = SeqDeserializer::new(list.into_iter());
        let value = visitor.visit_seq(&mut rest)?;
        rest.end()?;
        Ok(value)
    }

    fn deserialize_map<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Unfit> {
        match self {
            Self::Object(object) => visitor.visit_map(MapDeserializer::new(object.into_iter())),
            _ => Err(Unfit),
        }
    }

    fn deserialize_option<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Unfit> {
        match self {
            Self::Null => visitor.visit_none(),
            some => visitor.visit_some(some),
        }
    }

    fn deserialize_newtype_struct<V: Visitor<'de>>(
        self,
        _: &'static str,
        visitor: V,
    ) -> Result<V::Value, Unfit> {
        visitor.visit_newtype_struct(self)
    }

    /// Enumerations of the wire are words.
    fn deserialize_enum<V: Visitor<'de>>(
        self,
        _: &'static str,
        _: &'static [&'static str],
        visitor: V,
    ) -> Result<V::Value, Unfit> {
        match self {
            Self::Text(word) => visitor.visit_enum(word.into_deserializer()),
            _ => Err(Unfit),
        }
    }

    fn deserialize_tuple<V: Visitor<'de>>(self, _: usize, visitor: V) -> Result<V::Value, Unfit> {
        self.deserialize_seq(visitor)
    }

    fn deserialize_struct<V: Visitor<'de>>(
        self,
        _: &'static str,
        _: &'static [&'static str],
        visitor: V,
    ) -> Result<V::Value, Unfit> {
        self.deserialize_map(visitor)
    }

    fn deserialize_ignored_any<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Unfit> {
        visitor.visit_unit()
    }

    same! {
        deserialize_i8 deserialize_i16 deserialize_i32 deserialize_u8 deserialize_u16
        deserialize_u32 deserialize_u64 => deserialize_i64;
        deserialize_f32 => deserialize_f64;
        deserialize_str deserialize_identifier deserialize_char => deserialize_string;
    }

    forward_to_deserialize_any! { bytes byte_buf unit unit_struct tuple_struct }
}
