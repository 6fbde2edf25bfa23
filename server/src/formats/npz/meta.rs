//! Reads the array `meta`.

use super::arrays::values;
use sidestep::document::from_value;
use sidestep::invalid::Invalid;
use sidestep::reachability::npz::{FORMAT, Meta};
use sidestep::reachability::{Method, Nodes};
use std::io::{Read, Seek};
use zip::ZipArchive;

/// Reads `meta`. Its `format` must be [`FORMAT`], and its fields must be consistent.
pub(super) fn read_meta<R: Read + Seek>(archive: &mut ZipArchive<R>) -> Result<Meta, Invalid> {
    let bytes: Vec<u8> = values(archive, "meta", None)?;
    let json: serde_json::Value =
        serde_json::from_slice(&bytes).map_err(|e| Invalid::new("meta", "JSON", e))?;
    let found = json.get("format").cloned().unwrap_or_default();
    if found != FORMAT {
        return Err(Invalid::new("meta.format", format!("{FORMAT:?}"), found));
    }
    let meta: Meta = from_value(&json).map_err(|e| e.within("meta"))?;
    let coordinates = match meta.nodes {
        Nodes::Polar { .. } => "polar",
        Nodes::Cartesian { .. } => "cartesian",
    };
    if meta.coordinates != coordinates {
        let expected = format!("{coordinates:?}, as meta.nodes says");
        return Err(Invalid::new("meta.coordinates", expected, meta.coordinates));
    }
    if ![Method::Exact, Method::Polar, Method::Cartesian].iter().any(|m| m.name() == meta.method) {
        return Err(Invalid::new("meta.method", "exact, polar or cartesian", meta.method));
    }
    Ok(meta)
}
