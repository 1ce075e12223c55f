//! Identified values in a model file: a text and the values of a fit go in, the text with these values comes out. Everything
//! else stays as it is.

use crate::diagnostic::DiagnosticLog;
use crate::document::{self, TomlNode, TomlValue, find_key};

/// Identified values to be written into a model file.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct AdoptedValues {
    /// Where the values come from; printed as comment lines.
    pub comment: String,
    /// Values of parameters by their names.
    pub parameters: Vec<(String, f64)>,
    /// Values of base parameters by their expressions.
    pub base: Vec<(String, f64)>,
    /// Delays of the only actuators of drives, by the names of the drives, s.
    pub delays: Vec<(String, f64)>,
}

/// Writes identified values into the text of a model file and replaces earlier ones, except for delays that the file has;
/// everything else stays unchanged.
///
/// Fails if the text is not TOML, or if its table `identified` has another form than this function writes.
///
/// ```
/// use modelmill_spec::edit::{AdoptedValues, write_identified};
/// let values = AdoptedValues {
///     comment: "from a fit".to_owned(),
///     base: vec![("m*l".to_owned(), 2.5)],
///     ..AdoptedValues::default()
/// };
/// let text = write_identified("name = \"arm\" # mine\n", &values).unwrap();
/// assert_eq!(text, "name = \"arm\" # mine\n\n[identified]\n# from a fit\nbase = [\n  \
///                   { expression = \"m*l\", value = 2.5 },\n]\n");
/// assert_eq!(write_identified(&text, &values).unwrap(), text);
/// ```
pub fn write_identified(text: &str, values: &AdoptedValues) -> Result<String, String> {
    let text = &write_delays(text, &values.delays)?;
    let mut log = DiagnosticLog::default();
    let table = document::parse_toml(text, 0, &mut log);
    if log.n_errors() > 0 {
        return Err("this is not TOML; correct the file first".to_owned());
    }
    let line_end = if text.contains("\r\n") { "\r\n" } else { "\n" };
    let mut kept = text.to_owned();
    // An earlier table is removed from its header to its last line of values.
    if let Some((key, _)) = find_key(&table, "identified") {
        let start = text[..key.span.start].rfind('\n').map_or(0, |end| end + 1);
        if text[start..].lines().next().map(str::trim) != Some("[identified]") {
            return Err("write `[identified]` as a table of its own, on a line of its own".to_owned());
        }
        let mut end = text.len();
        let mut at = start;
        for line in text[start..].split_inclusive('\n') {
            if at > start && line.trim_start().starts_with('[') {
                end = at;
                break;
            }
            at += line.len();
        }
        // Comments and blank lines above the next table belong to that table.
        let own = &text[start..end];
        let last = own.trim_end().rfind(['\n', ']', '}']).unwrap_or(own.len() - 1);
        let own_end = own[last..].find('\n').map_or(own.len(), |line| last + line + 1);
        kept = format!("{}{}", text[..start].trim_end(), line_end);
        let rest = &text[start + own_end..];
        // The new table takes the place of the old one if other tables follow.
        if !rest.trim().is_empty() {
            let block = identified_table(values, line_end);
            return Ok(format!(
                "{kept}{line_end}{block}{line_end}{}",
                rest.trim_start_matches(['\r', '\n'])
            ));
        }
    }
    // Otherwise it is appended, separated by an empty line.
    if !kept.is_empty() {
        if !kept.ends_with('\n') {
            kept.push_str(line_end);
        }
        kept.push_str(line_end);
    }
    Ok(kept + &identified_table(values, line_end))
}

/// Writes delays into the actuators of some drives that have none. A delay of the file is kept.
///
/// Fails if the text is not TOML.
fn write_delays(text: &str, delays: &[(String, f64)]) -> Result<String, String> {
    let mut log = DiagnosticLog::default();
    let table = document::parse_toml(text, 0, &mut log);
    if log.n_errors() > 0 {
        return Err("this is not TOML; correct the file first".to_owned());
    }
    let mut edited = text.to_owned();
    let Some((
        _,
        TomlNode {
            value: TomlValue::Array(actuators),
            ..
        },
    )) = find_key(&table, "actuator")
    else {
        return Ok(edited);
    };
    // From the last to the first, so that places before an edit stay valid.
    for actuator in actuators.iter().rev() {
        let TomlValue::Table(entries) = &actuator.value else {
            continue;
        };
        let Some((
            _,
            TomlNode {
                value: TomlValue::Text { text: drive, .. },
                span,
            },
        )) = find_key(entries, "drive")
        else {
            continue;
        };
        let delay = delays.iter().find(|(name, _)| name == drive);
        let Some((_, delay)) = delay.filter(|_| find_key(entries, "delay").is_none()) else {
            continue;
        };
        let line = text[span.end..].split('\n').next().unwrap_or_default();
        let rest = line.trim();
        if rest.is_empty() || rest.starts_with('#') {
            let line_end = if line.ends_with('\r') { "\r\n" } else { "\n" };
            let at = span.end + line.trim_end_matches('\r').len();
            edited.insert_str(at, &format!("{line_end}delay = {delay:?}"));
        } else {
            // A table on one line.
            edited.insert_str(span.end, &format!(", delay = {delay:?}"));
        }
    }
    // An inline table over several lines is left as it is.
    let mut log = DiagnosticLog::default();
    document::parse_toml(&edited, 0, &mut log);
    Ok(if log.n_errors() > 0 { text.to_owned() } else { edited })
}

/// The text of the table of identified values.
fn identified_table(values: &AdoptedValues, line_end: &str) -> String {
    let mut lines = vec!["[identified]".to_owned()];
    // Control characters would end a comment.
    let comment = values.comment.lines();
    lines.extend(comment.map(|line| format!("# {}", line.replace(char::is_control, " "))));
    if !values.parameters.is_empty() {
        let pairs = values.parameters.iter();
        let pairs: Vec<String> = pairs.map(|(name, value)| format!("{name} = {value:?}")).collect();
        lines.push(format!("parameters = {{ {} }}", pairs.join(", ")));
    }
    if !values.base.is_empty() {
        lines.push("base = [".to_owned());
        for (expression, value) in &values.base {
            let expression = expression.replace('\\', "\\\\").replace('"', "\\\"");
            lines.push(format!("  {{ expression = \"{expression}\", value = {value:?} }},"));
        }
        lines.push("]".to_owned());
    }
    lines.join(line_end) + line_end
}

#[cfg(test)]
mod tests {
    use super::{AdoptedValues, write_identified};

    /// The text with a delay of 8 ms for the drive `motor`, without the table of identified values.
    fn with_delay(text: &str) -> String {
        let values = AdoptedValues {
            delays: vec![("motor".to_owned(), 0.008)],
            ..AdoptedValues::default()
        };
        let written = write_identified(text, &values).unwrap();
        written.split("[identified]").next().unwrap().trim_end().to_owned()
    }

    #[test]
    fn a_delay_is_written_below_the_drive_of_its_actuator() {
        let text = "[[actuator]]\ndrive = \"arm\"\n\n[[actuator]]\ndrive = \"motor\" # the first\nkp = 2";
        let wanted =
            "[[actuator]]\ndrive = \"arm\"\n\n[[actuator]]\ndrive = \"motor\" # the first\ndelay = 0.008\nkp = 2";
        assert_eq!(with_delay(text), wanted);
        let windows = |text: &str| text.replace('\n', "\r\n");
        assert_eq!(with_delay(&windows(text)), windows(wanted));
        let inline = with_delay("actuator = [{ drive = \"motor\", kp = 2 }]");
        assert_eq!(inline, "actuator = [{ drive = \"motor\", delay = 0.008, kp = 2 }]");
    }

    /// A delay of the file is kept, and a text that an edit would break stays as it is.
    #[test]
    fn a_delay_of_the_file_and_a_table_over_several_lines_are_kept() {
        for text in [
            "[[actuator]]\ndrive = \"motor\"\ndelay = 0.02",
            "[[actuator]]\ndrive = \"other\"",
            "actuator = [{ kp = 2, drive = \"motor\"\n}]",
            "name = \"arm\"",
        ] {
            assert_eq!(with_delay(text), text);
        }
    }
}
