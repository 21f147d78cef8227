//! Options of tables ([`OptionSpec`]) as arguments of clap.

use std::ops::{Deref, DerefMut};

use clap::builder::{PossibleValuesParser, TypedValueParser, ValueParser};
use clap::error::ErrorKind;
use clap::{Arg, ArgAction, ArgMatches, Args, Command, Error, FromArgMatches};

use kiln::scene::option::{OptionSpec, Options, ValueCount};
use kiln::scene::{GivenValue, OptionValue, ValueKind};

/// The arguments of a table of options.
#[derive(Debug, Clone, Default, PartialEq)]
pub(crate) struct Table<T>(pub T);

impl<T> Deref for Table<T> {
    type Target = T;

    fn deref(&self) -> &T {
        &self.0
    }
}

impl<T> DerefMut for Table<T> {
    fn deref_mut(&mut self) -> &mut T {
        &mut self.0
    }
}

impl<T: Options> Args for Table<T> {
    fn augment_args(command: Command) -> Command {
        command.args(T::specs().into_iter().map(argument))
    }

    fn augment_args_for_update(command: Command) -> Command {
        Self::augment_args(command)
    }
}

impl<T: Options> FromArgMatches for Table<T> {
    fn from_arg_matches(matches: &ArgMatches) -> Result<Self, Error> {
        let mut table = Self::default();
        table.update_from_arg_matches(matches)?;
        Ok(table)
    }

    fn update_from_arg_matches(&mut self, matches: &ArgMatches) -> Result<(), Error> {
        for spec in T::specs() {
            let id = &id_of(&spec.name);
            let value = match spec.count {
                ValueCount::Switch => matches.get_flag(id).then_some(GivenValue::Switch(true)),
                _ => matches.get_many::<String>(id).map(|texts| GivenValue::Texts(texts.cloned().collect())),
            };
            if value.is_some() {
                self.0
                    .set_by_name(&spec.name, value)
                    .map_err(|why| Error::raw(ErrorKind::ValueValidation, why))?;
            }
        }
        Ok(())
    }
}

/// A parser of values.
pub(crate) fn parser<T: OptionValue>() -> ValueParser {
    let names = T::names();
    if names.is_empty() {
        return ValueParser::new(T::parse);
    }
    ValueParser::new(PossibleValuesParser::new(names).try_map(|name| T::parse(&name)))
}

/// The identifier of an argument, as derives of clap give it.
fn id_of(name: &str) -> String {
    name.replace('-', "_")
}

/// The argument of an option.
fn argument(spec: OptionSpec) -> Arg {
    let OptionSpec { name, help, group, order, check, .. } = spec;
    let argument = Arg::new(id_of(&name)).long(name).help(help).help_heading(group);
    let argument = argument.display_order(order).alias(spec.alias);
    let action = match spec.count {
        ValueCount::Switch => return argument.action(ArgAction::SetTrue),
        ValueCount::One => ArgAction::Set,
        ValueCount::Many => ArgAction::Append,
    };
    let is_on_or_off = spec.kind == <bool as OptionValue>::kind();
    let checked = move |text: String| check(&text).map(|()| text);
    let parser = match spec.kind {
        ValueKind::Names(names) => ValueParser::new(PossibleValuesParser::new(names)),
        _ => ValueParser::new(clap::builder::StringValueParser::new().try_map(checked)),
    };
    let argument = argument.action(action).value_name(spec.value_name).value_parser(parser);
    let argument = argument.allow_hyphen_values(spec.takes_hyphens).ignore_case(spec.ignores_case);
    let argument = argument.hide_possible_values(spec.hides_values);
    match spec.bare {
        Some(bare) => argument.num_args(0..=1).require_equals(is_on_or_off).default_missing_value(bare),
        None => argument,
    }
}
