//! Spellings of keys, the same for all sections and inline tables: `color` is `colour`.

use std::collections::HashSet;

use toml::de::{DeTable, DeValue};

/// Renames the keys of a table and of those in it, except names that the user chose, and adds the byte offsets of colours
/// that look like shares of 1.
pub(super) fn unify(table: &mut DeTable, dark_colours: &mut Vec<usize>) {
    let typed = std::mem::take(table);
    let names: HashSet<String> = typed.keys().map(|key| key.get_ref().to_string()).collect();
    for (mut key, mut value) in typed {
        let spelled = key.get_ref().replace("color", "colour");
        // A key that is given in both spellings stays, and is unknown.
        if !names.contains(&spelled) {
            *key.get_mut() = spelled.into();
        }
        match value.get_mut() {
            DeValue::Table(named) if ["material", "effects"].contains(&key.get_ref().as_ref()) => {
                for (_, section) in named.iter_mut() {
                    unify_value(section.get_mut(), dark_colours);
                }
            }
            DeValue::Array(list) if is_dark(key.get_ref(), list.iter().map(|item| item.get_ref())) => {
                dark_colours.push(value.span().start);
            }
            inner => unify_value(inner, dark_colours),
        }
        table.insert(key, value);
    }
}

/// As [`unify`], for all tables in a value.
pub(super) fn unify_value(value: &mut DeValue, dark_colours: &mut Vec<usize>) {
    match value {
        DeValue::Table(table) => unify(table, dark_colours),
        DeValue::Array(list) => list.iter_mut().for_each(|item| unify_value(item.get_mut(), dark_colours)),
        _ => {}
    }
}

/// Whether numbers of a colour are 0 and 1 alone, where white is 255.
fn is_dark<'a>(key: &str, mut numbers: impl Iterator<Item = &'a DeValue<'a>> + Clone) -> bool {
    let is = |value: &DeValue, number: &str| matches!(value, DeValue::Integer(n) if n.as_str() == number);
    let is_colour = key.contains("colour") || key == "emission" || key == "background";
    is_colour
        && numbers.clone().any(|value| is(value, "1"))
        && numbers.all(|value| is(value, "0") || is(value, "1"))
}
