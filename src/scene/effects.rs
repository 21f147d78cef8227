//! What a scene says of effects, by name. Which effects there are, the room `effects` knows; it checks the names.

use std::collections::BTreeMap;

use schemars::JsonSchema;
use serde::Deserialize;

use crate::error::Place;

/// What is said of an effect.
#[derive(Debug, Clone, PartialEq, Deserialize, JsonSchema)]
#[serde(untagged, expecting = "expected true, false, or the effect's value")]
pub enum EffectValue {
    /// On or off.
    Switch(bool),
    /// On, with a number.
    Number(f64),
    /// On, with a word.
    Text(String),
}

impl EffectValue {
    /// Whether the effect is to be computed.
    pub fn is_on(&self) -> bool {
        *self != EffectValue::Switch(false)
    }

    /// The value, as it would be typed.
    pub fn value(&self) -> Option<String> {
        match self {
            EffectValue::Switch(_) => None,
            EffectValue::Number(number) => Some(number.to_string()),
            EffectValue::Text(text) => Some(text.clone()),
        }
    }
}

/// Effects turned on or off against what the scene's contents imply.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct EffectsSection(BTreeMap<String, (EffectValue, Option<Place>)>);

impl EffectsSection {
    /// What is said of the effect of this name.
    pub fn get(&self, name: &str) -> Option<&EffectValue> {
        self.0.get(name).map(|(value, _)| value)
    }

    /// Says something of an effect, at a place of a file.
    pub fn set(&mut self, name: &str, value: EffectValue, place: Option<Place>) {
        self.0.insert(name.to_owned(), (value, place));
    }

    /// Everything that is said: of which effect, what, and where.
    pub fn iter(&self) -> impl Iterator<Item = (&str, &EffectValue, Option<&Place>)> {
        self.0.iter().map(|(name, (value, place))| (name.as_str(), value, place.as_ref()))
    }

    /// This section's word where it has one, the other's where not.
    pub fn or(self, other: Self) -> Self {
        let mut both = other.0;
        both.extend(self.0);
        EffectsSection(both)
    }
}
