//! Values of options: text as typed and written, and ranges that types guarantee. The same parser and message serve
//! scene files and the command line.

pub(crate) mod bit_depth;
pub(crate) mod colour_value;
pub(crate) mod effects;
pub(crate) mod import_options;
pub(crate) mod picture;
pub(crate) mod sampling;
pub(crate) mod shading_mode;
mod spec;
pub(crate) mod transport;

pub use spec::{OptionSpec, ValueCount, group};

use super::Side;

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

    /// The value of an option that is on or off, or that may be given without a value.
    fn of_switch(is_on: bool) -> Option<Self> {
        let _ = is_on;
        None
    }

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

/// A value for an option that is set by its name.
#[derive(Debug, Clone, PartialEq)]
pub enum GivenValue {
    /// On or off.
    Switch(bool),
    /// As typed: the parts of a value, or the values of an option that may be repeated.
    Texts(Vec<String>),
}

impl From<&str> for GivenValue {
    fn from(text: &str) -> Self {
        GivenValue::Texts(vec![text.to_owned()])
    }
}

impl GivenValue {
    /// The value of an option.
    ///
    /// # Errors
    /// A message that states the valid values.
    fn parse<T: OptionValue>(&self) -> Result<T, String> {
        match self {
            GivenValue::Texts(parts) => T::parse(&parts.join(",")),
            &GivenValue::Switch(is_on) => T::of_switch(is_on)
                .ok_or_else(|| format!("takes a value, not {}", if is_on { "True" } else { "False" })),
        }
    }
}

/// An option: an `Option` of a value, a `Vec` of values, or a `bool` that is a switch.
pub(crate) trait OptionField {
    /// What the values are.
    fn kind(&self) -> ValueKind;

    /// The text of each value that is set.
    fn texts(&self) -> Vec<String>;

    /// Whether a value is set.
    fn is_set(&self) -> bool {
        !self.texts().is_empty()
    }

    /// Sets the value; `None` unsets it.
    ///
    /// # Errors
    /// A message that states the valid values.
    fn set(&mut self, value: Option<&GivenValue>) -> Result<(), String>;
}

/// The type of an [`OptionField`].
pub(crate) trait OptionType: OptionField + Default {
    /// How often it may be given.
    const COUNT: ValueCount;

    /// Checks a value as typed.
    ///
    /// # Errors
    /// A message that states the valid values.
    fn check(text: &str) -> Result<(), String>;
}

impl<T: OptionValue> OptionType for Option<T> {
    const COUNT: ValueCount = ValueCount::One;

    fn check(text: &str) -> Result<(), String> {
        T::parse(text).map(drop)
    }
}

impl<T: OptionValue> OptionField for Option<T> {
    fn kind(&self) -> ValueKind {
        T::kind()
    }

    fn texts(&self) -> Vec<String> {
        self.iter().map(T::text).collect()
    }

    fn is_set(&self) -> bool {
        self.is_some()
    }

    fn set(&mut self, value: Option<&GivenValue>) -> Result<(), String> {
        *self = value.map(GivenValue::parse).transpose()?;
        Ok(())
    }
}

impl<T: OptionValue> OptionType for Vec<T> {
    const COUNT: ValueCount = ValueCount::Many;

    fn check(text: &str) -> Result<(), String> {
        T::parse(text).map(drop)
    }
}

impl<T: OptionValue> OptionField for Vec<T> {
    fn kind(&self) -> ValueKind {
        T::kind()
    }

    fn texts(&self) -> Vec<String> {
        self.iter().map(T::text).collect()
    }

    fn set(&mut self, value: Option<&GivenValue>) -> Result<(), String> {
        *self = match value {
            Some(GivenValue::Texts(parts)) => {
                parts.iter().map(|part| T::parse(part)).collect::<Result<_, _>>()?
            }
            value => value.map(GivenValue::parse).transpose()?.into_iter().collect(),
        };
        Ok(())
    }
}

impl OptionType for bool {
    const COUNT: ValueCount = ValueCount::Switch;

    fn check(text: &str) -> Result<(), String> {
        <bool as OptionValue>::parse(text).map(drop)
    }
}

impl OptionField for bool {
    fn kind(&self) -> ValueKind {
        <bool as OptionValue>::kind()
    }

    fn texts(&self) -> Vec<String> {
        self.then(|| self.to_string()).into_iter().collect()
    }

    fn set(&mut self, value: Option<&GivenValue>) -> Result<(), String> {
        *self = value.map(GivenValue::parse).transpose()?.unwrap_or(false);
        Ok(())
    }
}

/// A row of a table of options.
pub(crate) struct OptionRow<'a> {
    /// Name, as in metadata and on the command line.
    pub name: String,
    /// Whether it is an option of its own, which is set by its name.
    pub is_option: bool,
    /// The value.
    pub field: &'a mut dyn OptionField,
}

/// A table of options ([`options`]), or a field of one.
pub(crate) trait OptionTable {
    /// The rows; `name` is that of the field.
    fn rows(&mut self, name: &str) -> Vec<OptionRow<'_>>;

    /// These options, and those of `other` that these do not set.
    #[must_use]
    fn or(self, other: Self) -> Self;
}

impl<T: OptionField> OptionTable for T {
    fn rows(&mut self, name: &str) -> Vec<OptionRow<'_>> {
        vec![OptionRow { name: name.replace('_', "-"), is_option: true, field: self }]
    }

    fn or(self, other: Self) -> Self {
        if self.is_set() { self } else { other }
    }
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

    fn of_switch(is_on: bool) -> Option<Self> {
        Some(is_on)
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

/// Width and height.
impl OptionValue for [Side; 2] {
    fn parse(text: &str) -> Result<Self, String> {
        match text.split_once(['x', 'X', ',']) {
            Some((width, height)) => Ok([Side::parse(width)?, Side::parse(height)?]),
            // A square.
            None if text.trim().starts_with(|c: char| c.is_ascii_digit()) => {
                Side::parse(text).map(|side| [side; 2])
            }
            None => Err("give it as WIDTHxHEIGHT, such as 640x480".into()),
        }
    }

    fn text(&self) -> String {
        self.map(|side| side.text()).join("x")
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

/// Implements [`OptionValue`] for enumerations by `name`; the values are those of a list, `ALL` by default.
#[macro_export]
macro_rules! named_values {
    ($($type:ty),* $(,)?) => { $($crate::scene::option::named_values!($type: <$type>::ALL);)* };
    ($type:ty: $values:expr) => {
        impl $crate::scene::OptionValue for $type {
            fn names() -> Vec<&'static str> {
                $values.into_iter().map(|value| value.name()).collect()
            }

            fn parse(text: &str) -> std::result::Result<Self, String> {
                let found = $values.into_iter().find(|value| value.name() == text);
                found.ok_or_else(|| $crate::error::nearest_name(text, &Self::names()))
            }

            fn text(&self) -> String {
                self.name().to_owned()
            }
        }
    };
}
pub use named_values;

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

/// A table of options that a command line takes.
pub trait Options: Default + Clone + Send + Sync + 'static {
    /// The options that are set by name.
    fn specs() -> Vec<OptionSpec>;

    /// Sets an option by its name; `None` unsets it. Other names do nothing.
    ///
    /// # Errors
    /// A message that states the valid values.
    fn set_by_name(&mut self, name: &str, value: Option<GivenValue>) -> Result<(), String>;
}

/// Declares types of numbers in a range, with the message for others. The type of the number is given twice, the second
/// time for serde. A unit may be typed after the number; a bare value is that of an option without one.
macro_rules! ranged {
    ($($(#[$doc:meta])* $name:ident($number:ident, $text:literal) in $range:expr, $message:literal $(, unit $unit:literal)? $(, bare $bare:expr)?;)*) => { $(
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
                $crate::scene::option::ValueKind::Number { range, is_whole: $text != "f64" }
            }

            fn parse(text: &str) -> std::result::Result<Self, String> {
                let text = text.trim();
                $(let text = text.strip_suffix($unit).map_or(text, str::trim_end);)?
                text.parse::<$number>().map_err(|_| $message.to_owned())?.try_into()
            }

            $(fn of_switch(is_on: bool) -> Option<Self> {
                is_on.then_some(Self($bare))
            })?

            fn text(&self) -> String {
                self.0.to_string()
            }
        }
    )* };
}
pub(crate) use ranged;

/// Declares a table of options: a struct with documentation, methods of [`OptionSpec`] in brackets (with a [`group`]), name
/// of the option where it is not that of the field, and type of each. `[flatten]` is another table, `[skip]` no option, and
/// `[skip = VALUE]` a part of another option, which is not set by its name. Documentation serves as rustdoc, description
/// of the schema and help text.
macro_rules! options {
    ($(#[$of_struct:meta])* pub struct $name:ident {
        $($(#[$($attribute:tt)*])* [$($arg:tt)*] $field:ident $(as $option:ident)?: $type:ty,)*
    }) => {
        $(#[$of_struct])*
        pub struct $name { $(
            $(#[$($attribute)*])*
            pub $field: $type,
        )* }

        impl $crate::scene::option::Options for $name {
            fn specs() -> Vec<$crate::scene::option::OptionSpec> {
                [$($crate::scene::option::row!(
                    specs [$($arg)*] $type, [$([$($attribute)*])*], $($option)? $field
                )),*].concat()
            }

            fn set_by_name(
                &mut self,
                name: &str,
                value: Option<$crate::scene::GivenValue>,
            ) -> std::result::Result<(), String> {
                self.set(name, value)
            }
        }

        impl $crate::scene::option::OptionTable for $name {
            fn rows(&mut self, _: &str) -> Vec<$crate::scene::option::OptionRow<'_>> {
                let mut rows = Vec::new();
                $($crate::scene::option::row!(rows [$($arg)*] rows, self.$field, $($option)? $field);)*
                rows
            }

            fn or(self, other: Self) -> Self {
                $name { $($field: $crate::scene::option::row!(or [$($arg)*] self.$field, other.$field),)* }
            }
        }

        impl $name {
            /// These options, and those of `other` that these do not set.
            pub fn or(self, other: Self) -> Self {
                $crate::scene::option::OptionTable::or(self, other)
            }

            fn rows(&mut self) -> Vec<$crate::scene::option::OptionRow<'_>> {
                $crate::scene::option::OptionTable::rows(self, "")
            }

            /// Name, as in metadata and on the command line, and text of each value that is set.
            pub fn entries(&self) -> Vec<(String, String)> {
                let mut own = self.clone();
                let of_row = |row: $crate::scene::option::OptionRow| {
                    row.field.texts().into_iter().map(move |text| (row.name.clone(), text))
                };
                own.rows().into_iter().flat_map(of_row).collect()
            }

            /// The text of an option by its name, if it is set.
            pub fn text(&self, name: &str) -> Option<String> {
                self.entries().into_iter().find(|(own, _)| own == name).map(|(_, text)| text)
            }

            /// Sets an option by its name; `None` unsets it. Other names do nothing.
            ///
            /// # Errors
            /// A message that states the valid values.
            pub fn set(
                &mut self,
                name: &str,
                value: Option<impl Into<$crate::scene::GivenValue>>,
            ) -> std::result::Result<(), String> {
                let row = self.rows().into_iter().find(|row| row.name == name);
                row.map_or(Ok(()), |row| row.field.set(value.map(Into::into).as_ref()))
            }

            /// The names of the options that are set by name.
            pub fn names() -> Vec<String> {
                let mut own = Self::default();
                own.rows().into_iter().filter(|row| row.is_option).map(|row| row.name).collect()
            }

            /// What the values of an option are; `None` if no option has this name.
            pub fn kind(name: &str) -> Option<$crate::scene::ValueKind> {
                let mut own = Self::default();
                own.rows().into_iter().find(|row| row.name == name).map(|row| row.field.kind())
            }
        }
    };
}
pub(crate) use options;

/// What [`options`] generates for a row.
macro_rules! row {
    (specs [flatten] $type:ty, [$($doc:tt)*], $name:ident) => {
        <$type as $crate::scene::option::Options>::specs()
    };
    (specs [skip $($value:tt)*] $type:ty, [$($doc:tt)*], $name:ident) => {
        Vec::new()
    };
    (specs [$($arg:tt)*] $type:ty, [$($doc:tt)*], $name:ident $($own:ident)?) => {{
        let lines = [$($crate::scene::option::row!(doc $doc)),*];
        let spec = $crate::scene::option::OptionSpec::new::<$type>(stringify!($name), &lines);
        vec![spec.$($arg)*]
    }};
    (doc [doc = $line:expr]) => {
        $line
    };
    (doc [$($other:tt)*]) => {
        ""
    };
    (rows [skip] $rows:ident, $field:expr, $name:ident) => {};
    (rows [skip = $value:expr] $rows:ident, $field:expr, $name:ident) => {
        let rows = $crate::scene::option::OptionTable::rows(&mut $field, stringify!($name)).into_iter();
        $rows.extend(rows.map(|row| $crate::scene::option::OptionRow { is_option: false, ..row }))
    };
    (rows [$($arg:tt)*] $rows:ident, $field:expr, $name:ident $($own:ident)?) => {
        $rows.extend($crate::scene::option::OptionTable::rows(&mut $field, stringify!($name)))
    };
    (or [skip] $own:expr, $other:expr) => {
        $own
    };
    (or [$($arg:tt)*] $own:expr, $other:expr) => {
        $crate::scene::option::OptionTable::or($own, $other)
    };
}
pub(crate) use row;
