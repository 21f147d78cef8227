//! Invalid values of a section, before it is known where the section stands.

/// Maximum of intensities and coefficients, so that their products are finite.
const MAX_INTENSITY: f64 = 1e100;

/// An invalid value and a hint.
#[derive(Debug)]
pub(crate) struct Fault {
    pub what: String,
    pub hint: String,
}

impl Fault {
    pub(super) fn new(what: impl Into<String>, hint: impl Into<String>) -> Self {
        Fault { what: what.into(), hint: hint.into() }
    }
}

/// Parses an inline table with the keys of a section.
///
/// # Errors
/// The hint for an unknown key names the nearest known key.
pub(super) fn parse_inline<T: for<'de> serde::Deserialize<'de>>(text: &str) -> Result<T, Fault> {
    let text = text.trim();
    let section = toml::de::DeValue::parse(text).and_then(|mut value| {
        crate::import::formats::scene_file::spelling::unify_value(value.get_mut(), &mut Vec::new());
        T::deserialize(toml::de::ValueDeserializer::from(value))
    });
    section
        .map_err(|e| crate::import::formats::scene_file::toml_error::explain(e, text))
        .map_err(|e| Fault::new(e.what, e.hint))
}

/// Checks that an intensity or a coefficient is from 0 to [`MAX_INTENSITY`].
pub(super) fn not_negative(key: &str, value: f64) -> Result<f64, Fault> {
    if value > MAX_INTENSITY && value.is_finite() {
        Err(Fault::new(format!("`{key}` is {value:e}"), "give at most 1e100"))
    } else if value >= 0.0 && value.is_finite() {
        Ok(value)
    } else {
        Err(Fault::new(format!("`{key}` is {value}"), "give a number that is 0 or more"))
    }
}

/// Checks that a value is from 0 to 1.
pub(super) fn unit(key: &str, value: f64) -> Result<f64, Fault> {
    if (0.0..=1.0).contains(&value) {
        return Ok(value);
    }
    Err(Fault::new(format!("`{key}` is {value}"), "give a number from 0 to 1"))
}
