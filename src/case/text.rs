//! The text of a case file. A deck is written as one, `--set` replaces entries before the text is read, and serde reads
//! its tables. A path gives the line of an entry, and the parser's errors become ours.
//!
//! Entries are named by paths such as `support[1].axis.point`, whose numbers count from 0; `material[]` is the last of several.

use super::Tables;
use crate::deck::{AnyDefinition, Deck};
use crate::model::{Definition, Number, nearest};
use serde::de::value::Error as Unsaid;
use serde::de::{Deserialize, DeserializeOwned, Deserializer, Error as _, MapAccess, Visitor};
use std::fmt::{self, Write as _};
use std::ops::Range;
use std::sync::LazyLock;
use toml::Spanned;
use toml::de::{DeTable, DeValue, Error};
use toml_edit::{DocumentMut, Item, Value};

/// A deck as the text of a case file, with a comment above each table that names its line.
pub(super) fn of_deck(deck: &Deck) -> String {
    let mut document = DocumentMut::new();
    if !deck.title.is_empty() {
        document["title"] = deck.title.as_str().into();
    }
    document["mesh"] = Item::Table([("file", deck.mesh_file.as_str())].into_iter().collect());
    let written = match &deck.definition {
        AnyDefinition::Plane(definition) => write(definition, &mut document),
        AnyDefinition::Space(definition) => write(definition, &mut document),
    };
    written.expect("decks state numbers and expressions");
    for origin in &deck.origins {
        let (key, number) = origin.table.split_once('[').unwrap_or((&origin.table, ""));
        let number = number.trim_end_matches(']').parse();
        let table = match (&mut document[key], number) {
            (Item::ArrayOfTables(tables), Ok(number)) => tables.get_mut(number),
            (item, _) => item.as_table_mut(),
        };
        if let Some(table) = table {
            let place = format!("\n# {}, line {}\n", origin.file.display(), origin.line);
            table.decor_mut().set_prefix(place);
        }
    }
    document.to_string().trim_start().to_owned()
}

/// Adds the tables of a model to a document.
///
/// # Errors
/// If a quantity is a function that a program states.
pub(super) fn write<const D: usize>(
    definition: &Definition<D>,
    document: &mut DocumentMut,
) -> Result<(), toml_edit::ser::Error> {
    for (key, mut item) in toml_edit::ser::to_document(definition)?.into_table() {
        (item.as_value_mut()).into_iter().for_each(shorten);
        let item = match item.into_array_of_tables() {
            Ok(tables) => Item::ArrayOfTables(tables),
            Err(item) => match item.into_table() {
                Ok(table) if !table.is_empty() => Item::Table(table),
                // Nothing is stated of this kind: the list or the table is empty.
                _ => continue,
            },
        };
        document.insert(&key, item);
    }
    Ok(())
}

/// Writes large and small numbers with an exponent.
fn shorten(value: &mut Value) {
    match value {
        Value::Float(number) => {
            let (short, decor) = (Number(*number.value()).to_string(), number.decor().clone());
            if let Ok(short) = short.parse() {
                *value = short;
                *value.decor_mut() = decor;
            }
        }
        Value::Array(list) => list.iter_mut().for_each(shorten),
        Value::InlineTable(table) => table.iter_mut().for_each(|(_, entry)| shorten(entry)),
        _ => {}
    }
}

/// Puts one `key.path=value` into the document.
pub(super) fn set(document: &mut DocumentMut, setting: &str) -> Result<(), String> {
    let (key, value) = setting
        .split_once('=')
        .ok_or("write it as key.path=value")?;
    let value = value.trim();
    // A value that is not TOML counts as a string, so that shells need no second pair of quotes.
    let value: Value = value.parse().unwrap_or_else(|_| Value::from(value));
    let mut parts: Vec<&str> = key.trim().split('.').collect();
    let last = parts
        .pop()
        .filter(|k| !k.is_empty())
        .ok_or("the key is empty")?;
    const CHOICES: [&str; 2] = ["friction", "obstacle"];
    let parent = parts.last().copied().unwrap_or("");
    let mut item = document.as_item_mut();
    for part in parts {
        item = match part.parse::<usize>() {
            Ok(index) => {
                let length = match &*item {
                    Item::ArrayOfTables(tables) => tables.len(),
                    other => other.as_array().map_or(0, toml_edit::Array::len),
                };
                if index >= length {
                    return Err(format!(
                        "there is no entry {index} (they count from 0, and there are {length})"
                    ));
                }
                &mut item[index]
            }
            Err(_) => {
                let table = item
                    .as_table_like_mut()
                    .ok_or_else(|| format!("\"{part}\" is inside an entry that is not a table"))?;
                if !table.contains_key(part) {
                    table.insert(part, Item::Table(toml_edit::Table::new()));
                }
                table.get_mut(part).expect("just inserted")
            }
        };
    }
    if let (Ok(index), Some(list)) = (last.parse::<usize>(), item.as_array_mut()) {
        let length = list.len();
        if index >= length {
            return Err(format!(
                "there is no entry {index} (they count from 0, and there are {length})"
            ));
        }
        list.replace(index, value);
        return Ok(());
    }
    let table = item
        .as_table_like_mut()
        .ok_or_else(|| format!("\"{last}\" would be inside an entry that is not a table"))?;
    // Only one of these entries is allowed: a new one replaces the old one.
    if CHOICES.contains(&parent) {
        let others: Vec<String> = table.iter().map(|(key, _)| key.to_owned()).collect();
        others.iter().filter(|key| *key != last).for_each(|key| {
            table.remove(key);
        });
    }
    table.insert(last, Item::Value(value));
    Ok(())
}

/// The keys that a type has as a table.
fn keys<T: DeserializeOwned>() -> &'static [&'static str] {
    /// Records the requested fields, and has none.
    struct Ear<'a>(&'a mut &'static [&'static str]);

    impl<'de> Deserializer<'de> for Ear<'_> {
        type Error = Unsaid;

        fn deserialize_any<V: Visitor<'de>>(self, _: V) -> Result<V::Value, Unsaid> {
            Err(Unsaid::custom("it has no fields"))
        }

        fn deserialize_struct<V: Visitor<'de>>(
            self,
            _: &'static str,
            fields: &'static [&'static str],
            visitor: V,
        ) -> Result<V::Value, Unsaid> {
            *self.0 = fields;
            self.deserialize_any(visitor)
        }

        serde::forward_to_deserialize_any! {
            bool i8 i16 i32 i64 i128 u8 u16 u32 u64 u128 f32 f64 char str string bytes byte_buf option unit unit_struct
            newtype_struct seq tuple tuple_struct map enum identifier ignored_any
        }
    }

    let mut found: &[&str] = &[];
    // It ends in the error above.
    let _ = T::deserialize(Ear(&mut found));
    found
}

/// The tables that describe bodies, which an algebraic case must not have.
pub(super) static OF_BODIES: LazyLock<Vec<&str>> = LazyLock::new(|| {
    let all = keys::<Definition>().iter().copied();
    all.filter(|key| *key != "units").collect()
});

/// All tables.
static KNOWN: LazyLock<Vec<&str>> = LazyLock::new(|| {
    let (own, of_bodies) = (keys::<Tables>(), OF_BODIES.iter());
    let others = of_bodies.filter(|key| !own.contains(*key));
    own.iter().chain(others).copied().collect()
});

/// The tables of a text that a type has keys for, as this type.
pub(super) fn read<T: DeserializeOwned>(text: &str) -> Result<T, Error> {
    with_keys(text, |key| keys::<T>().contains(&key))
}

/// Whether it has no other tables than those of case files.
pub(super) fn check_keys(text: &str) -> Result<(), Error> {
    with_keys::<Nothing>(text, |key| !KNOWN.contains(&key)).map(drop)
}

fn with_keys<T: DeserializeOwned>(text: &str, wanted: impl Fn(&str) -> bool) -> Result<T, Error> {
    let document = DeTable::parse(text)?;
    let span = document.span();
    let tables = document.into_inner().into_iter();
    let tables = tables.filter(|(key, _)| wanted(key.get_ref())).collect();
    let document = Spanned::new(span, tables);
    T::deserialize(toml::de::Deserializer::from(document)).map_err(|mut error| {
        error.set_input(Some(text));
        error
    })
}

/// A table where every key is one too many.
struct Nothing;

struct UnknownKey;

impl<'de> Deserialize<'de> for UnknownKey {
    fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        Err(D::Error::unknown_field(&String::deserialize(from)?, &KNOWN))
    }
}

impl<'de> Deserialize<'de> for Nothing {
    fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        from.deserialize_map(Self)
    }
}

impl<'de> Visitor<'de> for Nothing {
    type Value = Self;

    fn expecting(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str("tables of a case file")
    }

    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Self, A::Error> {
        map.next_key::<UnknownKey>().map(|_| self)
    }
}

/// The range of an entry in a text, or of its parent, and whether the entry itself exists.
fn found(text: &str, path: &str) -> Option<(Range<usize>, bool)> {
    let document = DeTable::parse(text).ok()?.into_inner();
    let (root, mut span) = (DeValue::Table(document), None);
    let mut item = &root;
    for step in path.split(['.', '[']) {
        let step = step.trim_end_matches(']');
        let next = match item {
            DeValue::Table(table) => table.get(step),
            DeValue::Array(list) => match step.parse::<usize>() {
                Ok(number) => list.get(number),
                Err(_) => list.iter().last(),
            },
            _ => None,
        };
        let Some(next) = next else {
            return span.map(|span| (span, false));
        };
        (item, span) = (next.get_ref(), Some(next.span()));
    }
    span.map(|span| (span, true))
}

/// Whether an entry is there.
pub(super) fn has(text: &str, path: &str) -> bool {
    found(text, path).is_some_and(|(_, whole)| whole)
}

/// The range of an entry in a text, or of its parent; if neither exists, that of the mesh.
pub(super) fn span(text: &str, path: &str) -> Range<usize> {
    let found = found(text, path).or_else(|| found(text, "mesh"));
    match path {
        "" => 0..0,
        _ => found.map_or(0..0, |(span, _)| span),
    }
}

/// The path of the entry at a position of a text, or of the innermost table around it.
pub(super) fn path(text: &str, at: usize) -> String {
    /// The path that ends the farthest inside.
    fn inside(item: &DeValue, at: usize, path: &str) -> Option<String> {
        let has = |span: Range<usize>| span.contains(&at);
        match item {
            DeValue::Table(table) => table.iter().find_map(|(key, value)| {
                let dot = if path.is_empty() { "" } else { "." };
                let path = format!("{path}{dot}{}", key.get_ref());
                let deeper = inside(value.get_ref(), at, &path);
                deeper.or_else(|| (has(key.span()) || has(value.span())).then_some(path))
            }),
            DeValue::Array(list) => list.iter().enumerate().find_map(|(number, value)| {
                // Numbers in a list have no names.
                let path = match value.get_ref() {
                    DeValue::Table(_) => format!("{path}[{number}]"),
                    _ => path.to_owned(),
                };
                let deeper = inside(value.get_ref(), at, &path);
                deeper.or_else(|| has(value.span()).then_some(path))
            }),
            _ => None,
        }
    }
    let Ok(document) = DeTable::parse(text) else {
        return String::new();
    };
    inside(&DeValue::Table(document.into_inner()), at, "").unwrap_or_default()
}

/// An entry in words: its table, with its number where there are several like it in the text, and its key.
pub(super) fn words(text: &str, path: &str) -> String {
    let steps: Vec<&str> = path.split('.').collect();
    let length = match steps[0].contains('[') || steps.len() < 3 {
        true => 1,
        false => 2,
    };
    let mut words = String::new();
    for (place, step) in steps.iter().enumerate() {
        words += match place {
            0 => "",
            place if place == length => ", ",
            _ => ".",
        };
        let (name, number) = step.split_once('[').unwrap_or((step, ""));
        words += name;
        let number = number.trim_end_matches(']').parse::<usize>();
        if let (Ok(number), true) = (number, place < length) {
            let before: Vec<&str> = steps[..place].iter().copied().chain([name]).collect();
            if has(text, &format!("{}[1]", before.join("."))) {
                // Nothing is in the way of writing into a text.
                let _ = write!(words, " {}", number + 1);
            }
        }
    }
    words
}

/// A message of the parser about an entry, with the known key closest to an unknown one.
pub(super) fn suggested(message: &str, path: &str) -> String {
    let quoted = |text: &str| -> Vec<String> {
        text.split('`')
            .skip(1)
            .step_by(2)
            .map(str::to_owned)
            .collect()
    };
    const LAWS: &str = "\"none\", { tresca = 1e6 } (Pa) or { coulomb = 0.3 }";
    const FORMS: [&str; 3] = [
        "unit variant, expected newtype",
        "wanted string or table",
        "wanted exactly 1",
    ];
    if path.ends_with("friction") && FORMS.iter().any(|text| message.contains(text)) {
        return format!("{message}; a friction law is written as {LAWS}");
    }
    // The line shows that it is the header of a table.
    let single = message.contains(&format!("[{path}]"));
    if single && message.contains("invalid type: map, expected a sequence") {
        return format!(
            "{message}; there may be several of these: write [[{path}]], with double brackets"
        );
    }
    let unknown = message.lines().find_map(|line| {
        line.split_once("unknown field ")
            .or(line.split_once("unknown variant "))
    });
    let names = unknown.map_or(Vec::new(), |(_, names)| quoted(names));
    match names
        .split_first()
        .map(|(wrong, known)| nearest(wrong, known))
    {
        Some(Some(name)) => format!("{message}; did you mean `{name}`?"),
        _ => message.to_owned(),
    }
}
