//! Serializes types to JSON text.

use super::number;
use super::read::Unfit;
use serde::Serialize;
use serde::ser::{
    Impossible, SerializeMap, SerializeSeq, SerializeStruct, SerializeTuple, Serializer,
};

/// Appends one value to a text.
pub(super) struct Writer<'a>(pub(super) &'a mut String);

fn quote(text: &str, out: &mut String) {
    const HEX: &[u8; 16] = b"0123456789abcdef";
    out.push('"');
    for c in text.chars() {
        match c {
            '"' | '\\' => out.extend(['\\', c]),
            c if (c as u32) < 0x20 => {
                let code = c as usize;
                out.push_str("\\u00");
                out.extend([HEX[code >> 4] as char, HEX[code & 15] as char]);
            }
            c => out.push(c),
        }
    }
    out.push('"');
}

/// Writes the entries of a list or an object.
pub(super) struct Entries<'a> {
    out: &'a mut String,
    is_first: bool,
    close: char,
}

impl<'a> Entries<'a> {
    fn open(out: &'a mut String, open: char, close: char) -> Self {
        out.push(open);
        Self { out, is_first: true, close }
    }

    fn next(&mut self) -> Writer<'_> {
        if !std::mem::take(&mut self.is_first) {
            self.out.push(',');
        }
        Writer(self.out)
    }

    fn add<T: Serialize + ?Sized>(&mut self, value: &T) -> Result<(), Unfit> {
        value.serialize(self.next())
    }

    fn name<T: Serialize + ?Sized>(&mut self, name: &T) -> Result<(), Unfit> {
        self.add(name)?;
        self.out.push(':');
        Ok(())
    }

    fn close(self) -> Result<(), Unfit> {
        self.out.push(self.close);
        Ok(())
    }
}

/// Formats a whole number as a double. Whole numbers in wire types are small enough to be exact.
macro_rules! numbers {
    ($($method:ident $type:ty),*) => {$(
        fn $method(self, number: $type) -> Result<(), Unfit> {
            self.serialize_f64(number as f64)
        }
    )*};
}

/// Methods for data types that wire types do not use.
macro_rules! never {
    ($($method:ident($($type:ty),*) -> $answer:ty;)*) => {$(
        fn $method(self, $(_: $type),*) -> Result<$answer, Unfit> {
            Err(Unfit)
        }
    )*};
}

impl<'a> Serializer for Writer<'a> {
    type Ok = ();
    type Error = Unfit;
    type SerializeSeq = Entries<'a>;
    type SerializeTuple = Entries<'a>;
    type SerializeMap = Entries<'a>;
    type SerializeStruct = Entries<'a>;
    type SerializeTupleStruct = Impossible<(), Unfit>;
    type SerializeTupleVariant = Impossible<(), Unfit>;
    type SerializeStructVariant = Impossible<(), Unfit>;

    numbers!(
        serialize_i8 i8, serialize_i16 i16, serialize_i32 i32, serialize_i64 i64,
        serialize_u8 u8, serialize_u16 u16, serialize_u32 u32, serialize_u64 u64,
        serialize_f32 f32
    );

    never! {
        serialize_bytes(&[u8]) -> ();
        serialize_tuple_struct(&'static str, usize) -> Self::SerializeTupleStruct;
        serialize_tuple_variant(&'static str, u32, &'static str, usize)
            -> Self::SerializeTupleVariant;
        serialize_struct_variant(&'static str, u32, &'static str, usize)
            -> Self::SerializeStructVariant;
    }

    fn serialize_newtype_variant<T: Serialize + ?Sized>(
        self,
        _: &'static str,
        _: u32,
        _: &'static str,
        _: &T,
    ) -> Result<(), Unfit> {
        Err(Unfit)
    }

    fn serialize_f64(self, value: f64) -> Result<(), Unfit> {
        if !value.is_finite() {
            return self.serialize_unit();
        }
        // The browser would write −0 without its sign.
        let is_negative_zero = value == 0.0 && value.is_sign_negative();
        self.0.push_str(&if is_negative_zero { "-0.0".to_owned() } else { number(value) });
        Ok(())
    }

    fn serialize_bool(self, flag: bool) -> Result<(), Unfit> {
        self.0.push_str(if flag { "true" } else { "false" });
        Ok(())
    }

    fn serialize_unit(self) -> Result<(), Unfit> {
        self.0.push_str("null");
        Ok(())
    }

    fn serialize_unit_struct(self, _: &'static str) -> Result<(), Unfit> {
        self.serialize_unit()
    }

    fn serialize_none(self) -> Result<(), Unfit> {
        self.serialize_unit()
    }

    fn serialize_some<T: Serialize + ?Sized>(self, value: &T) -> Result<(), Unfit> {
        value.serialize(self)
    }

    fn serialize_str(self, text: &str) -> Result<(), Unfit> {
        quote(text, self.0);
        Ok(())
    }

    fn serialize_char(self, c: char) -> Result<(), Unfit> {
        self.serialize_str(c.encode_utf8(&mut [0; 4]))
    }

    fn serialize_unit_variant(
        self,
        _: &'static str,
        _: u32,
        word: &'static str,
    ) -> Result<(), Unfit> {
        self.serialize_str(word)
    }

    fn serialize_newtype_struct<T: Serialize + ?Sized>(
        self,
        _: &'static str,
        value: &T,
    ) -> Result<(), Unfit> {
        value.serialize(self)
    }

    fn serialize_seq(self, _: Option<usize>) -> Result<Entries<'a>, Unfit> {
        Ok(Entries::open(self.0, '[', ']'))
    }

    fn serialize_tuple(self, _: usize) -> Result<Entries<'a>, Unfit> {
        self.serialize_seq(None)
    }

    fn serialize_map(self, _: Option<usize>) -> Result<Entries<'a>, Unfit> {
        Ok(Entries::open(self.0, '{', '}'))
    }

    fn serialize_struct(self, _: &'static str, _: usize) -> Result<Entries<'a>, Unfit> {
        self.serialize_map(None)
    }
}

impl SerializeSeq for Entries<'_> {
    type Ok = ();
    type Error = Unfit;

    fn serialize_element<T: Serialize + ?Sized>(&mut self, value: &T) -> Result<(), Unfit> {
        self.add(value)
    }

    fn end(self) -> Result<(), Unfit> {
        self.close()
    }
}

impl SerializeTuple for Entries<'_> {
    type Ok = ();
    type Error = Unfit;

    fn serialize_element<T: Serialize + ?Sized>(&mut self, value: &T) -> Result<(), Unfit> {
        self.add(value)
    }

    fn end(self) -> Result<(), Unfit> {
        self.close()
    }
}

impl SerializeStruct for Entries<'_> {
    type Ok = ();
    type Error = Unfit;

    fn serialize_field<T: Serialize + ?Sized>(
        &mut self,
        name: &'static str,
        value: &T,
    ) -> Result<(), Unfit> {
        self.name(name)?;
        value.serialize(Writer(self.out))
    }

    fn end(self) -> Result<(), Unfit> {
        self.close()
    }
}

/// Map keys are strings.
impl SerializeMap for Entries<'_> {
    type Ok = ();
    type Error = Unfit;

    fn serialize_key<T: Serialize + ?Sized>(&mut self, name: &T) -> Result<(), Unfit> {
        self.name(name)
    }

    fn serialize_value<T: Serialize + ?Sized>(&mut self, value: &T) -> Result<(), Unfit> {
        value.serialize(Writer(self.out))
    }

    fn end(self) -> Result<(), Unfit> {
        self.close()
    }
}
