//! `manual`: the reference of all commands and options as Markdown, or manual pages (man). Both are made from the
//! declarations of the command line.

use std::fmt::Write as _;

use clap::builder::PossibleValue;
use clap::{Arg, ArgAction, Command, CommandFactory};
use clap_mangen::Man;
use modelmill::identify::EstimatorOptions;
use modelmill::options::{DeclaredOptions, find_flag};
use modelmill::recording::RecordingOptions;

use crate::args::{CommandLine, ManualArgs};
use crate::failure::{CommandFailure, CommandOutcome};
use crate::output::{OutputSet, make_folder, refuse_dash};
use crate::terminal;

/// Prints the reference, or writes manual pages into the folder of `--out`.
pub(crate) fn run(args: &ManualArgs) -> CommandOutcome {
    let mut program = CommandLine::command();
    program.build();
    let Some(folder) = &args.out else {
        return terminal::print(&reference_page(&program));
    };
    refuse_dash("--out", folder)?;
    make_folder(folder)?;
    let mut outputs = OutputSet::default();
    let own = commands_of(&program).map(|command| (format!("modelmill-{}.1", command.get_name()), command));
    let pages: Vec<(String, &Command)> = std::iter::once(("modelmill.1".to_owned(), &program))
        .chain(own)
        .collect();
    for (name, command) in &pages {
        let page = manual_page(command).map_err(|error| CommandFailure::Input(format!("{name}: {error}")))?;
        outputs.add_path(folder.join(name), page);
    }
    outputs.write()?;
    terminal::note(&format!(
        "{}: {} manual pages; `man {}` shows one",
        folder.display(),
        pages.len(),
        folder.join("modelmill.1").display()
    ));
    Ok(())
}

/// The commands without `help`.
fn commands_of(program: &Command) -> impl Iterator<Item = &Command> {
    program.get_subcommands().filter(|command| command.get_name() != "help")
}

/// The manual page of the program or a command, without a date.
fn manual_page(command: &Command) -> std::io::Result<String> {
    let title = command.get_display_name().unwrap_or(command.get_name()).to_uppercase();
    let mut page = Vec::new();
    Man::new(command.clone())
        .title(title)
        .date("")
        .source(concat!("modelmill ", env!("CARGO_PKG_VERSION")))
        .render(&mut page)?;
    Ok(String::from_utf8_lossy(&page).into_owned())
}

/// Options of one heading of a command.
struct OptionGroup<'a> {
    /// The heading; none for the options that are shown first.
    heading: Option<&'a str>,
    options: Vec<&'a Arg>,
}

impl OptionGroup<'_> {
    /// Whether another group shows the same.
    fn is_like(&self, other: &OptionGroup<'_>) -> bool {
        self.heading == other.heading && option_table(self) == option_table(other)
    }
}

/// All commands with their options as Markdown. Groups of options that several commands have are shown once.
fn reference_page(program: &Command) -> String {
    let mut page = "# Commands and options\n\n\
        `modelmill manual` prints this page from the declarations of the program.\n\
        `modelmill help COMMAND` shows a command in a terminal, with examples; `modelmill manual --out DIR` writes manual pages.\n\
        `help(modelmill.Model.identify)` in Python shows keywords and their explanations.\n\n\
        ## Options of every command\n\n"
        .to_owned();
    let of_all = OptionGroup {
        heading: None,
        options: program.get_arguments().filter(|one| one.is_global_set()).collect(),
    };
    page.push_str(&option_table(&of_all));
    let commands: Vec<(&Command, Vec<OptionGroup>)> =
        commands_of(program).map(|one| (one, option_groups(one))).collect();
    let mut shared: Vec<&OptionGroup> = Vec::new();
    for group in commands
        .iter()
        .flat_map(|(_, groups)| groups)
        .filter(|group| group.heading.is_some())
    {
        let owners = commands
            .iter()
            .filter(|(_, groups)| groups.iter().any(|other| other.is_like(group)));
        if owners.count() > 1 && !shared.iter().any(|other| other.is_like(group)) {
            shared.push(group);
        }
    }
    for group in &shared {
        let _ = write!(page, "\n## {}\n\n", group.heading.unwrap_or_default());
        page.push_str(&option_table(group));
    }
    for (command, groups) in &commands {
        let about = command.get_about().map(ToString::to_string).unwrap_or_default();
        let _ = write!(
            page,
            "\n## {}\n\n{about}.\n\n`{}`\n",
            command.get_name(),
            usage(command)
        );
        for group in groups {
            match group.heading {
                Some(heading) if shared.iter().any(|other| other.is_like(group)) => {
                    let anchor = heading.to_lowercase().replace(' ', "-");
                    let _ = write!(page, "\nAlso the options of [{heading}](#{anchor}).\n");
                    continue;
                }
                Some(heading) => {
                    let _ = write!(page, "\n{heading}:\n\n");
                }
                None => page.push('\n'),
            }
            page.push_str(&option_table(group));
        }
    }
    page
}

/// How a command is called: arguments and required options.
fn usage(command: &Command) -> String {
    let mut usage = format!("modelmill {}", command.get_name());
    for one in command.get_positionals() {
        let several = one.get_num_args().is_some_and(|range| range.max_values() > 1);
        let more = if several { "..." } else { "" };
        let name = value_text(one);
        let _ = if one.is_required_set() {
            write!(usage, " {name}{more}")
        } else {
            write!(usage, " [{name}]{more}")
        };
    }
    for one in command.get_opts().filter(|one| one.is_required_set()) {
        let _ = write!(usage, " --{} {}", one.get_long().unwrap_or_default(), value_text(one));
    }
    usage + " [OPTIONS]"
}

/// The arguments and options of a command by their headings; those without a heading come first, as in the help.
fn option_groups(command: &Command) -> Vec<OptionGroup<'_>> {
    let mut groups = vec![OptionGroup {
        heading: None,
        options: Vec::new(),
    }];
    for one in command.get_arguments() {
        if one.is_global_set() || one.get_id() == "help" || one.is_hide_set() {
            continue;
        }
        let heading = one.get_help_heading();
        match groups.iter_mut().find(|group| group.heading == heading) {
            Some(group) => group.options.push(one),
            None => groups.push(OptionGroup {
                heading,
                options: vec![one],
            }),
        }
    }
    groups.retain(|group| !group.options.is_empty());
    groups
}

/// A table of options, with the keywords of Python where options are declared in the library.
fn option_table(group: &OptionGroup<'_>) -> String {
    let declared = [RecordingOptions::HEADING, EstimatorOptions::HEADING];
    let has_keywords = group.heading.is_some_and(|heading| declared.contains(&heading));
    let mut table = if has_keywords {
        "| option | in Python | what it does |\n|---|---|---|\n".to_owned()
    } else {
        "| option | what it does |\n|---|---|\n".to_owned()
    };
    for one in &group.options {
        let is_switch = matches!(one.get_action(), ArgAction::SetTrue);
        let name = match one.get_long() {
            None => value_text(one),
            Some(long) if is_switch => format!("--{long}"),
            Some(long) => format!("--{long} {}", value_text(one)),
        };
        let _ = write!(table, "| `{}` | ", escape_cell(&name));
        if has_keywords {
            let is_declared = find_flag(one.get_id().as_str()) == one.get_long();
            let _ = if is_declared {
                write!(table, "`{}` | ", one.get_id())
            } else {
                write!(table, "| ")
            };
        }
        let _ = writeln!(table, "{} |", escape_cell(&explanation(one)));
    }
    table
}

/// The help of an option with its values and its default.
fn explanation(one: &Arg) -> String {
    let mut text = one.get_help().map(ToString::to_string).unwrap_or_default();
    let is_switch = matches!(one.get_action(), ArgAction::SetTrue);
    let values: Vec<PossibleValue> = one.get_possible_values();
    if !values.is_empty() && !is_switch {
        let each = values.iter().map(|value| match value.get_help() {
            Some(help) => format!("`{}`: {help}", value.get_name()),
            None => format!("`{}`", value.get_name()),
        });
        let _ = write!(text, ". Values: {}", each.collect::<Vec<_>>().join("; "));
    }
    let defaults: Vec<String> = one
        .get_default_values()
        .iter()
        .map(|value| value.display().to_string())
        .collect();
    if !defaults.is_empty() && !is_switch && !one.is_hide_default_value_set() {
        let _ = write!(text, ". Default: `{}`", defaults.join(","));
    }
    text
}

/// What stands for the value of an argument.
fn value_text(one: &Arg) -> String {
    let names = one.get_value_names().unwrap_or_default();
    names.iter().map(ToString::to_string).collect::<Vec<_>>().join(" ")
}

/// A text as a cell of a table.
fn escape_cell(text: &str) -> String {
    text.replace('|', "\\|").replace('\n', " ")
}
