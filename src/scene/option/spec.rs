//! What a command line shows of options: names, help, headings.

use super::{OptionType, OptionValue, ValueKind};

/// Headings under which the help lists options.
pub mod group {
    #![allow(missing_docs)]
    pub const OUTPUT: &str = "Output";
    pub const CAMERA: &str = "Camera";
    pub const LIGHT: &str = "Light";
    pub const LOOK: &str = "Look";
    pub const QUALITY: &str = "Quality";
    pub const ANIMATION: &str = "Animation";
    pub const INPUT: &str = "Input";
    pub const MEASUREMENT: &str = "Measurement";
    pub const LIMITS: &str = "Speed and limits";
}

/// What a command line and its help show of an option.
#[derive(Debug, Clone)]
pub struct OptionSpec {
    /// The name on the command line.
    pub name: String,
    /// What it does.
    pub help: String,
    /// Heading in the help.
    pub group: &'static str,
    /// Place under the heading; `None` for that in the table.
    pub order: Option<usize>,
    /// What stands for the value in the help.
    pub value_name: String,
    /// What the values are.
    pub kind: ValueKind,
    /// How often it may be given.
    pub count: ValueCount,
    /// Whether values may begin with a hyphen.
    pub takes_hyphens: bool,
    /// Whether the help leaves out the list of values.
    pub hides_values: bool,
    /// Whether case does not matter in values.
    pub ignores_case: bool,
    /// Another name.
    pub alias: Option<&'static str>,
    /// The value if it is given without one.
    pub bare: Option<&'static str>,
    /// Checks a value as typed: a message that states the valid values.
    pub check: fn(&str) -> Result<(), String>,
}

/// How often an option may be given.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ValueCount {
    /// Once, without a value.
    Switch,
    /// Once.
    One,
    /// Several times.
    Many,
}

impl OptionSpec {
    /// The option of a field, with the lines of its documentation, of which empty ones do not count.
    pub(crate) fn new<T: OptionType>(field: &str, documentation: &[&str]) -> Self {
        let lines: Vec<&str> =
            documentation.iter().map(|line| line.trim()).filter(|line| !line.is_empty()).collect();
        let kind = T::default().kind();
        let is_on_or_off = T::COUNT == ValueCount::One && kind == <bool as OptionValue>::kind();
        OptionSpec {
            name: field.replace('_', "-"),
            help: lines.join(" ").trim_end_matches('.').to_owned(),
            group: "",
            order: None,
            value_name: if is_on_or_off { "true|false".into() } else { field.to_uppercase() },
            kind,
            count: T::COUNT,
            takes_hyphens: false,
            hides_values: is_on_or_off,
            ignores_case: false,
            alias: None,
            bare: is_on_or_off.then_some("true"),
            check: T::check,
        }
    }

    pub(crate) fn of(self, group: &'static str) -> Self {
        OptionSpec { group, ..self }
    }

    pub(crate) fn order(self, order: usize) -> Self {
        OptionSpec { order: Some(order), ..self }
    }

    pub(crate) fn value_name(self, name: &str) -> Self {
        OptionSpec { value_name: name.to_owned(), ..self }
    }

    pub(crate) fn help(self, help: String) -> Self {
        OptionSpec { help, ..self }
    }

    pub(crate) fn hyphens(self) -> Self {
        OptionSpec { takes_hyphens: true, ..self }
    }

    pub(crate) fn hides_values(self) -> Self {
        OptionSpec { hides_values: true, ..self }
    }

    pub(crate) fn ignores_case(self) -> Self {
        OptionSpec { ignores_case: true, ..self }
    }

    pub(crate) fn alias(self, alias: &'static str) -> Self {
        OptionSpec { alias: Some(alias), ..self }
    }

    pub(crate) fn bare(self, value: &'static str) -> Self {
        OptionSpec { bare: Some(value), ..self }
    }
}
