//! JSON as the objects that Python would make of it.

use std::path::Path;

use vpr_core::{Error, Result};
use vpr_files::pickle::Value;

/// What a JSON file holds.
pub(super) fn read(path: &Path, bytes: &[u8]) -> Result<Value> {
    let value = serde_json::from_slice(bytes)
        .map_err(|err| Error::format(path, format!("line {}", err.line()), err.to_string()))?;
    Ok(of(value))
}

fn of(value: serde_json::Value) -> Value {
    use serde_json::Value as Json;
    match value {
        Json::Null => Value::None,
        Json::Bool(value) => Value::Bool(value),
        Json::Number(number) => match number.as_i64() {
            Some(value) => Value::Int(value),
            None => Value::Float(number.as_f64().unwrap_or(f64::NAN)),
        },
        Json::String(text) => Value::Text(text),
        Json::Array(values) => Value::List(values.into_iter().map(of).collect()),
        Json::Object(entries) => {
            Value::Dict(entries.into_iter().map(|(key, value)| (key_of(key), of(value))).collect())
        }
    }
}

/// JSON has no other keys than text: one of digits is an index.
fn key_of(key: String) -> Value {
    match key.parse() {
        Ok(index) if key.bytes().all(|byte| byte.is_ascii_digit()) => Value::Int(index),
        _ => Value::Text(key),
    }
}
