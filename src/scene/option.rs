//! Values of options: text as typed and written, and ranges that types guarantee. The same parser and message serve
//! scene files and the command line.

/// A value of an option.
pub trait OptionValue: Sized + Clone + Send + Sync + 'static {
    /// The names of all values, if these are a list.
    fn names() -> Vec<&'static str> {
        Vec::new()
    }

    /// What the values are.
    fn kind() -> ValueKind {
        match Self::names() {
            names if names.is_empty() => ValueKind::Text,
            names => ValueKind::Names(names.into_iter().map(str::to_owned).collect()),
        }
    }

    /// Parses a value as typed.
    ///
    /// # Errors
    /// A message that states the valid values.
    fn parse(text: &str) -> Result<Self, String>;

    /// The value as text, which parses to the same value.
    fn text(&self) -> String;
}

/// What the values of an option are, for controls that set it by their texts.
#[derive(Debug, Clone, PartialEq)]
pub enum ValueKind {
    /// One of a list.
    Names(Vec<String>),
    /// A number in a range.
    Number {
        /// The least and the largest.
        range: [f64; 2],
        /// Whether it is a whole number.
        is_whole: bool,
    },
    /// Any other text.
    Text,
}

impl OptionValue for u32 {
    fn kind() -> ValueKind {
        ValueKind::Number { range: [0.0, f64::from(u32::MAX)], is_whole: true }
    }

    fn parse(text: &str) -> Result<Self, String> {
        text.trim().parse().map_err(|_| format!("give a whole number from 0 to {}", u32::MAX))
    }

    fn text(&self) -> String {
        self.to_string()
    }
}

impl OptionValue for bool {
    fn names() -> Vec<&'static str> {
        vec!["true", "false"]
    }

    fn parse(text: &str) -> Result<Self, String> {
        text.parse().map_err(|_| "give true or false".into())
    }

    fn text(&self) -> String {
        self.to_string()
    }
}

impl OptionValue for String {
    fn parse(text: &str) -> Result<Self, String> {
        Ok(text.to_owned())
    }

    fn text(&self) -> String {
        self.clone()
    }
}

impl OptionValue for crate::film::Window {
    fn parse(text: &str) -> Result<Self, String> {
        let numbers: Option<Vec<u32>> = text.split(',').map(|number| number.trim().parse().ok()).collect();
        match numbers.as_deref() {
            Some(&[x, y, width, height]) if width > 0 && height > 0 => Ok(Self { x, y, width, height }),
            _ => Err("give it as X,Y,WIDTH,HEIGHT in pixels, width and height above 0".into()),
        }
    }

    fn text(&self) -> String {
        let Self { x, y, width, height } = self;
        format!("{x},{y},{width},{height}")
    }
}

/// Implements [`OptionValue`] for enumerations by `ALL` and `name`.
macro_rules! named_values {
    ($($type:ty),* $(,)?) => { $(
        impl OptionValue for $type {
            fn names() -> Vec<&'static str> {
                <$type>::ALL.iter().map(|value| value.name()).collect()
            }

            fn parse(text: &str) -> std::result::Result<Self, String> {
                let found = <$type>::ALL.into_iter().find(|value| value.name() == text);
                found.ok_or_else(|| format!("give one of {}", Self::names().join(", ")))
            }

            fn text(&self) -> String {
                self.name().to_owned()
            }
        }
    )* };
}
pub(crate) use named_values;

named_values!(
    crate::bvh::Preset,
    crate::film::ColourPipeline,
    crate::film::FilterShape,
    crate::film::tone::ToneMap,
    super::Numerics,
    super::PixelSampler,
    super::Projection,
    super::ShadingMode,
    super::Transport,
);

/// Headings under which the help lists options.
#[cfg(feature = "cli")]
pub(crate) mod group {
    pub(crate) const OUTPUT: &str = "Output";
    pub(crate) const CAMERA: &str = "Camera";
    pub(crate) const LIGHT: &str = "Light";
    pub(crate) const LOOK: &str = "Look";
    pub(crate) const QUALITY: &str = "Quality";
    pub(crate) const ANIMATION: &str = "Animation";
    pub(crate) const INPUT: &str = "Input";
    pub(crate) const MEASUREMENT: &str = "Measurement";
    pub(crate) const LIMITS: &str = "Speed and limits";
}

/// A parser for the command line.
#[cfg(feature = "cli")]
pub(crate) fn parser<T: OptionValue>() -> clap::builder::ValueParser {
    use clap::builder::{PossibleValuesParser, TypedValueParser, ValueParser};
    let names = T::names();
    if names.is_empty() {
        return ValueParser::new(T::parse);
    }
    ValueParser::new(PossibleValuesParser::new(names).try_map(|name| T::parse(&name)))
}

/// Declares types of numbers in a range, with the message for others. The type of the number is given twice, the second
/// time for serde. A unit may be typed after the number.
macro_rules! ranged {
    ($($(#[$doc:meta])* $name:ident($number:ident, $text:literal) in $range:expr, $message:literal $(, unit $unit:literal)?;)*) => { $(
        $(#[$doc])*
        #[derive(Debug, Clone, Copy, PartialEq, PartialOrd)]
        #[derive(serde::Serialize, serde::Deserialize, schemars::JsonSchema)]
        #[serde(try_from = $text, into = $text)]
        pub struct $name($number);

        impl $name {
            /// The nearest value in the range; its start for NaN.
            pub fn clamped(value: $number) -> Self {
                let range = $range;
                if value >= *range.start() { Self(value.min(*range.end())) } else { Self(*range.start()) }
            }

            /// The number.
            pub const fn get(self) -> $number {
                self.0
            }
        }

        impl TryFrom<$number> for $name {
            type Error = String;

            fn try_from(value: $number) -> std::result::Result<Self, String> {
                $range.contains(&value).then_some(Self(value)).ok_or_else(|| $message.into())
            }
        }

        impl From<$name> for $number {
            fn from(value: $name) -> Self {
                value.0
            }
        }

        impl OptionValue for $name {
            fn kind() -> $crate::scene::option::ValueKind {
                let range = [*$range.start(), *$range.end()].map(f64::from);
                $crate::scene::option::ValueKind::Number { range, is_whole: $text == "u32" }
            }

            fn parse(text: &str) -> std::result::Result<Self, String> {
                let text = text.trim();
                $(let text = text.strip_suffix($unit).map_or(text, str::trim_end);)?
                text.parse::<$number>().map_err(|_| $message.to_owned())?.try_into()
            }

            fn text(&self) -> String {
                self.0.to_string()
            }
        }
    )* };
}
pub(crate) use ranged;

/// Declares a struct of options, each an `Option` with its documentation, command-line option (the arguments of clap's
/// `arg` with its [`group`], or `skip`) and type. Documentation serves as rustdoc, description of the schema and help text.
macro_rules! options {
    ($(#[$of_struct:meta])* pub struct $name:ident {
        $($(#[$attribute:meta])* [$($arg:tt)*] $field:ident: $type:ty,)*
    }) => {
        $(#[$of_struct])*
        #[cfg_attr(feature = "cli", derive(clap::Args))]
        pub struct $name { $(
            $(#[$attribute])*
            #[cfg_attr(feature = "cli", arg($($arg)*))]
            pub $field: Option<$type>,
        )* }

        impl $name {
            /// These options, and those of `other` that these do not set.
            pub fn or(self, other: Self) -> Self {
                $name { $($field: self.$field.or(other.$field),)* }
            }

            /// Name, as in metadata and on the command line, and text of each option that is set.
            pub fn entries(&self) -> Vec<(String, String)> {
                let mut entries = Vec::new();
                $(entries.extend(self.$field.as_ref().map(|value| {
                    (stringify!($field).replace('_', "-"), $crate::scene::OptionValue::text(value))
                }));)*
                entries
            }

            /// The text of an option by its name, if it is set.
            pub fn text(&self, name: &str) -> Option<String> {
                self.entries().into_iter().find(|(own, _)| own == name).map(|(_, text)| text)
            }

            /// Sets an option by its name to a value as typed; `None` unsets it.
            ///
            /// # Errors
            /// A message that states the valid values.
            pub fn set(&mut self, name: &str, text: Option<&str>) -> std::result::Result<(), String> {
                let field = name.replace('-', "_");
                $(if field == stringify!($field) {
                    self.$field = text.map($crate::scene::OptionValue::parse).transpose()?;
                })*
                Ok(())
            }

            /// What the values of an option are; `None` if no option has this name.
            pub fn kind(name: &str) -> Option<$crate::scene::ValueKind> {
                let field = name.replace('-', "_");
                $(if field == stringify!($field) {
                    return Some(<$type as $crate::scene::OptionValue>::kind());
                })*
                None
            }
        }
    };
}
pub(crate) use options;
