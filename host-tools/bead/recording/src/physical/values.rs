//! Values of settings by their keys.

use bead_model::design::Description;
use bead_model::violation::SettingKey;
use serde_json::Value;

/// The value of a setting.
pub fn value(description: &Description, key: SettingKey) -> Value {
    // A struct of numbers and texts is always JSON.
    let all = serde_json::to_value(description).unwrap_or_default();
    all.pointer(&pointer(key)).cloned().unwrap_or_default()
}

/// Place of a setting in the JSON of a description.
pub(crate) fn pointer(key: SettingKey) -> String {
    format!("/{}", key.path().replace('.', "/"))
}

/// A value as TOML, and as people read it.
pub fn shown(value: &Value) -> String {
    match value {
        Value::Number(number) if number.is_f64() => match number.as_f64() {
            Some(float) if float != 0.0 && !(1e-3..1e6).contains(&float.abs()) => format!("{float:e}"),
            Some(float) => format!("{float:?}"),
            None => number.to_string(),
        },
        Value::Null => "unknown".to_owned(),
        // As in TOML: quotes and control characters escaped.
        other => other.to_string(),
    }
}
