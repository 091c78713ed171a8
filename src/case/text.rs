//! The text of a case file: entries that are replaced before it is read, and the parser's errors.

use crate::model::nearest;

/// Puts one `key.path=value` into the document.
pub(super) fn set(document: &mut toml_edit::DocumentMut, setting: &str) -> Result<(), String> {
    let (key, value) = setting
        .split_once('=')
        .ok_or("write it as key.path=value")?;
    let value = value.trim();
    // What is no TOML value is meant as a string, so that shells need no second pair of quotes.
    let value: toml_edit::Value = value
        .parse()
        .unwrap_or_else(|_| toml_edit::Value::from(value));
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
                    toml_edit::Item::ArrayOfTables(tables) => tables.len(),
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
                    .ok_or_else(|| format!("\"{part}\" lies in something that is no table"))?;
                if !table.contains_key(part) {
                    table.insert(part, toml_edit::Item::Table(toml_edit::Table::new()));
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
        .ok_or_else(|| format!("\"{last}\" would lie in something that is no table"))?;
    // Of these only one entry can stand: a new one replaces what was there.
    if CHOICES.contains(&parent) {
        let others: Vec<String> = table.iter().map(|(key, _)| key.to_owned()).collect();
        others.iter().filter(|key| *key != last).for_each(|key| {
            table.remove(key);
        });
    }
    table.insert(last, toml_edit::Item::Value(value));
    Ok(())
}

/// What stands at a place of a text whose keys have a line each: the table, with its number where there are several like it, and
/// the key.
pub(super) fn place(text: &str, at: usize) -> String {
    let at = at.min(text.len());
    let begin = text[..at].rfind('\n').map_or(0, |end| end + 1);
    let line = text[begin..].lines().next().unwrap_or_default();
    let header = |line: &str| {
        line.starts_with('[')
            .then(|| line.trim_matches(['[', ']']).to_owned())
    };
    let through = &text[..begin + line.len()];
    let Some(table) = through.lines().rev().find_map(header) else {
        return line.split('=').next().unwrap_or_default().trim().to_owned();
    };
    let count = |text: &str| {
        text.lines()
            .filter(|line| header(line).as_ref() == Some(&table))
            .count()
    };
    let number = match count(text) {
        1 => String::new(),
        _ => format!(" {}", count(through)),
    };
    match line.split_once('=') {
        Some((key, _)) if !line.starts_with('[') => format!("{table}{number}, {}", key.trim()),
        _ => format!("{table}{number}"),
    }
}

/// A message of the parser, with the known key that an unknown one may have meant.
pub(super) fn suggested(message: &str) -> String {
    let quoted = |text: &str| -> Vec<String> {
        text.split('`')
            .skip(1)
            .step_by(2)
            .map(str::to_owned)
            .collect()
    };
    let unknown = message
        .lines()
        .find_map(|line| {
            line.split_once("unknown field ")
                .or(line.split_once("unknown variant "))
        })
        .map(|(_, names)| quoted(names));
    const LAWS: &str = "\"none\", { tresca = 1e6 } (Pa) or { coulomb = 0.3 }";
    if message.contains("friction")
        && [
            "unit variant, expected newtype",
            "wanted string or table",
            "wanted exactly 1",
        ]
        .iter()
        .any(|text| message.contains(text))
    {
        return format!("{message}; a friction law is written as {LAWS}");
    }
    // A table where a list of tables is wanted: the line shows which.
    let single = message.lines().find_map(|line| {
        let (_, header) = line.split_once('[')?;
        header.split_once(']').map(|(name, _)| name)
    });
    if let Some(name) = single.filter(|name| !name.contains('['))
        && message.contains("invalid type: map, expected a sequence")
    {
        return format!(
            "{message}; there may be several of these: write [[{name}]], with double brackets"
        );
    }
    let Some((wrong, known)) = unknown.as_ref().and_then(|names| names.split_first()) else {
        return message.to_owned();
    };
    match nearest(wrong, known) {
        Some(name) => format!("{message}; did you mean `{name}`?"),
        None => message.to_owned(),
    }
}
