//! Effect settings of a scene, by effect name. The module `effects` defines the effects and validates the names.

use std::collections::BTreeMap;

use schemars::JsonSchema;
use serde::Deserialize;

use crate::error::Place;

/// Setting of one effect.
#[derive(Debug, Clone, PartialEq, Deserialize, JsonSchema)]
#[serde(untagged, expecting = "expected true, false, or the effect's value")]
pub enum EffectValue {
    /// On or off without a value.
    Switch(bool),
    /// On, with a numeric value.
    Number(f64),
    /// On, with a text value.
    Text(String),
}

impl EffectValue {
    /// Whether the effect is on.
    pub fn is_on(&self) -> bool {
        *self != EffectValue::Switch(false)
    }

    /// The value as text, as typed by users.
    pub fn value(&self) -> Option<String> {
        match self {
            EffectValue::Switch(_) => None,
            EffectValue::Number(number) => Some(number.to_string()),
            EffectValue::Text(text) => Some(text.clone()),
        }
    }
}

/// Effects turned on or off explicitly, overriding what the scene's contents imply, each with its place in the input.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct EffectsSection(BTreeMap<String, (EffectValue, Option<Place>)>);

impl EffectsSection {
    /// Setting of the effect named `name`.
    pub fn get(&self, name: &str) -> Option<&EffectValue> {
        self.0.get(name).map(|(value, _)| value)
    }

    /// Sets an effect; `place` is the position in the input file.
    pub fn set(&mut self, name: &str, value: EffectValue, place: Option<Place>) {
        self.0.insert(name.to_owned(), (value, place));
    }

    /// All settings: name, value and place.
    pub fn iter(&self) -> impl Iterator<Item = (&str, &EffectValue, Option<&Place>)> {
        self.0.iter().map(|(name, (value, place))| (name.as_str(), value, place.as_ref()))
    }

    /// Merges two sections; the settings of `self` take precedence.
    pub fn or(self, other: Self) -> Self {
        let mut both = other.0;
        both.extend(self.0);
        EffectsSection(both)
    }
}
