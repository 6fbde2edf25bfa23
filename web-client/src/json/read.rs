//! Parses a text into a tree of values, and deserializes types from the tree.

use serde::de::value::StrDeserializer;
use serde::de::{DeserializeSeed, Deserializer, MapAccess, SeqAccess, Visitor};
use serde::forward_to_deserialize_any;
use std::fmt;

/// A JSON value.
pub(super) enum Json {
    Null,
    Bool(bool),
    Number(f64),
    Text(String),
    List(Vec<Json>),
    /// Names and values.
    Object(Vec<(String, Json)>),
}

/// The error for a value that does not have the expected shape. It has no details, because nobody
/// sees them, and because the code to format them would cancel much of the savings.
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

    fn invalid_length(_: usize, _: &dyn serde::de::Expected) -> Self {
        Self
    }
}

/// Parses a text, in the browser.
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

/// Parses a text, without a browser.
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

/// The largest magnitude up to which a double represents every whole number exactly.
const WHOLE: f64 = 9_007_199_254_740_992.0;

macro_rules! same {
    ($($($method:ident)* => $other:ident;)*) => {$($(
        fn $method<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Unfit> {
            self.$other(visitor)
        }
    )*)*};
}

/// A type that requests a specific format is deserialized only from that format. So the compiler
/// can omit the large amount of code for all other formats. Nothing is moved out of the tree, so
/// there is never a partially moved value to drop.
impl<'de> Deserializer<'de> for &Json {
    type Error = Unfit;

    fn deserialize_any<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Unfit> {
        match self {
            Json::Null => visitor.visit_unit(),
            Json::Bool(_) => self.deserialize_bool(visitor),
            // Visitors of whole numbers accept only whole numbers. Visitors of floats accept both.
            Json::Number(n) if is_whole(*n) && n.to_bits() != (-0.0f64).to_bits() => {
                self.deserialize_i64(visitor)
            }
            Json::Number(_) => self.deserialize_f64(visitor),
            Json::Text(_) => self.deserialize_str(visitor),
            Json::List(_) => self.deserialize_seq(visitor),
            Json::Object(_) => self.deserialize_map(visitor),
        }
    }

    fn deserialize_bool<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Unfit> {
        match self {
            Json::Bool(flag) => visitor.visit_bool(*flag),
            _ => Err(Unfit),
        }
    }

    fn deserialize_f64<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Unfit> {
        match self {
            Json::Number(number) => visitor.visit_f64(*number),
            _ => Err(Unfit),
        }
    }

    fn deserialize_i64<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Unfit> {
        match self {
            Json::Number(number) if is_whole(*number) => visitor.visit_i64(*number as i64),
            _ => Err(Unfit),
        }
    }

    fn deserialize_str<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Unfit> {
        match self {
            Json::Text(text) => visitor.visit_str(text),
            _ => Err(Unfit),
        }
    }

    fn deserialize_seq<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Unfit> {
        let Json::List(list) = self else { return Err(Unfit) };
        let mut rest = list.iter();
        let value = visitor.visit_seq(Items(&mut rest))?;
        if rest.next().is_some() { Err(Unfit) } else { Ok(value) }
    }

    fn deserialize_map<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Unfit> {
        match self {
            Json::Object(fields) => visitor.visit_map(Fields(fields)),
            _ => Err(Unfit),
        }
    }

    fn deserialize_option<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Unfit> {
        match self {
            Json::Null => visitor.visit_none(),
            some => visitor.visit_some(some),
        }
    }

    fn deserialize_tuple<V: Visitor<'de>>(self, _: usize, visitor: V) -> Result<V::Value, Unfit> {
        self.deserialize_seq(visitor)
    }

    /// A struct is read as the sequence of its fields in declaration order. For each type, the
    /// compiler can then leave out name matching, the detection of duplicates and the drops of
    /// partial values.
    fn deserialize_struct<V: Visitor<'de>>(
        self,
        _: &'static str,
        names: &'static [&'static str],
        visitor: V,
    ) -> Result<V::Value, Unfit> {
        match self {
            Json::Object(fields) => visitor.visit_seq(Struct { fields, names: names.iter() }),
            _ => Err(Unfit),
        }
    }

    fn deserialize_newtype_struct<V: Visitor<'de>>(
        self,
        _: &'static str,
        visitor: V,
    ) -> Result<V::Value, Unfit> {
        visitor.visit_newtype_struct(self)
    }

    /// Enumerations in wire types are strings.
    fn deserialize_enum<V: Visitor<'de>>(
        self,
        _: &'static str,
        _: &'static [&'static str],
        visitor: V,
    ) -> Result<V::Value, Unfit> {
        match self {
            Json::Text(word) => visitor.visit_enum(StrDeserializer::new(word)),
            _ => Err(Unfit),
        }
    }

    fn deserialize_ignored_any<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Unfit> {
        visitor.visit_unit()
    }

    same! {
        deserialize_i8 deserialize_i16 deserialize_i32 deserialize_u8 deserialize_u16
        deserialize_u32 deserialize_u64 => deserialize_i64;
        deserialize_f32 => deserialize_f64;
        deserialize_string deserialize_identifier deserialize_char => deserialize_str;
    }

    forward_to_deserialize_any! { bytes byte_buf unit unit_struct tuple_struct }
}

fn is_whole(number: f64) -> bool {
    number as i64 as f64 == number && number.abs() <= WHOLE
}

/// The remaining items of a list.
struct Items<'a, 'b>(&'a mut std::slice::Iter<'b, Json>);

impl<'de> SeqAccess<'de> for Items<'_, '_> {
    type Error = Unfit;

    fn next_element_seed<T: DeserializeSeed<'de>>(
        &mut self,
        seed: T,
    ) -> Result<Option<T::Value>, Unfit> {
        self.0.next().map(|item| seed.deserialize(item)).transpose()
    }

    fn size_hint(&self) -> Option<usize> {
        Some(self.0.len())
    }
}

/// The fields of an object in the declaration order of a type.
struct Struct<'a> {
    fields: &'a [(String, Json)],
    names: std::slice::Iter<'static, &'static str>,
}

impl Struct<'_> {
    #[inline(never)]
    fn next(&mut self) -> Option<&Json> {
        let name = self.names.next()?;
        self.fields.iter().find(|(known, _)| known == name).map(|(_, value)| value)
    }
}

impl<'de> SeqAccess<'de> for Struct<'_> {
    type Error = Unfit;

    fn next_element_seed<T: DeserializeSeed<'de>>(
        &mut self,
        seed: T,
    ) -> Result<Option<T::Value>, Unfit> {
        let value = self.next();
        match (seed.deserialize(value.unwrap_or(&Json::Null)), value) {
            (Ok(read), _) => Ok(Some(read)),
            // An absent field that is not optional gets its default, if it has one.
            (Err(_), None) => Ok(None),
            (Err(unfit), Some(_)) => Err(unfit),
        }
    }
}

/// The remaining fields of an object. The first field stays until its value has been read.
struct Fields<'a>(&'a [(String, Json)]);

impl<'de> MapAccess<'de> for Fields<'_> {
    type Error = Unfit;

    fn next_key_seed<K: DeserializeSeed<'de>>(
        &mut self,
        seed: K,
    ) -> Result<Option<K::Value>, Unfit> {
        let name = self.0.first().map(|(name, _)| StrDeserializer::new(name));
        name.map(|name| seed.deserialize(name)).transpose()
    }

    fn next_value_seed<T: DeserializeSeed<'de>>(&mut self, seed: T) -> Result<T::Value, Unfit> {
        let Some(((_, value), rest)) = self.0.split_first() else { return Err(Unfit) };
        self.0 = rest;
        seed.deserialize(value)
    }
}
